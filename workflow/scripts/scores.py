"""Score the reference run and the design against the targets."""

from radcal.calibration.scoring import score, score_reference
from radcal.objectives import make_objectives
from radcal.objectives.history import History, write_runs
from radcal.session.jobs import job, progress
from radcal.storage.runs import in_all_passes, indexed
from radcal.targets.target import Targets

with job(snakemake) as case:
    targets = [Targets.read(path) for path in snakemake.input.target]
    store, passes = (snakemake.params.runs, case.calibrated), len(snakemake.input.target)
    reference = [records for records, _ in in_all_passes(indexed([file], *store) for file in snakemake.input.reference)]
    objectives = make_objectives(case, targets)
    runs = score_reference(case, reference, targets, objectives)
    for kind, files in (
        ("registration", snakemake.input.registration),
        ("reused", snakemake.input.reused),
        ("design", snakemake.input.design),
    ):
        chunks = len(files) // passes
        each = [files[number * chunks : (number + 1) * chunks] for number in range(passes)]
        listed = in_all_passes(indexed(one, *store) for one in each)
        runs += [
            score(kind, k, records, parameters, targets, objectives, case.seed)
            for k, (records, parameters) in enumerate(listed)
        ]
    write_runs(snakemake.output.scores, runs)
    best = {name: History(runs).best(name).rms for name in targets[0]}
    for name, rms in best.items():
        made = History(runs).count("design")
        of = f"the density of {name} in the best run so far"
        progress(f"after {made} design runs, {of} differs from the measured one by {rms:.2e} per dB (rms)")

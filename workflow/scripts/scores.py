"""Score the reference run and the design against the targets."""

from radcal.calibration.history import History, indexed, score, write_runs
from radcal.config import Case
from radcal.jobs import logged, progress
from radcal.measurement.target import read_targets

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    targets = read_targets(snakemake.input.target)
    runs = [
        score(kind, k, record, parameters, targets, other_law=others)
        for kind, files, others in (
            ("reference", [snakemake.input.reference], case.start_with_another_law),
            ("design", snakemake.input.design, []),
        )
        for k, (record, parameters) in enumerate(indexed(files, snakemake.params.runs, case.calibrated))
    ]
    write_runs(snakemake.output.scores, runs)
    best = {name: History(runs).best(name).rms[name] for name in targets}
    for name, rms in best.items():
        progress(f"design of {len(runs) - 1} runs: best rms of {name} {rms:.2e}")

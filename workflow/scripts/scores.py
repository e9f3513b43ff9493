"""Score the reference run and the design against the targets."""

from radcal.calibration.history import indexed, score, write_runs
from radcal.calibration.steps import reference_parameters, score_reference
from radcal.config import Case
from radcal.jobs import logged, progress
from radcal.measurement.target import read_targets

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    targets = read_targets(snakemake.input.target)
    reference = [record for record, _ in indexed([snakemake.input.reference], snakemake.params.runs, case.calibrated)]
    design = indexed(snakemake.input.design, snakemake.params.runs, case.calibrated)
    runs = score_reference(reference, reference_parameters(case), targets)
    runs += [score("design", k, record, parameters, targets) for k, (record, parameters) in enumerate(design)]
    write_runs(snakemake.output.scores, runs)
    size = len(runs) - len(reference)
    for name in targets:
        progress(f"design of {size} runs: best rms of {name} {min(run.rms[name] for run in runs):.2e}")

"""Score the reference run and the design against the targets."""

from radcal.calibration.history import indexed, score, write_runs
from radcal.config import Case
from radcal.jobs import logged, progress
from radcal.measurement.target import read_targets

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    targets = read_targets(snakemake.input.target)
    runs = [
        score(kind, k, record, parameters, targets)
        for kind, files in (("reference", [snakemake.input.reference]), ("design", snakemake.input.design))
        for k, (record, parameters) in enumerate(indexed(files, snakemake.params.runs, case.calibrated))
    ]
    write_runs(snakemake.output.scores, runs)
    for name in targets:
        progress(f"design of {len(runs) - 1} runs: best rms of {name} {min(run.rms[name] for run in runs):.2e}")

"""Simulate one chunk of the design."""

from radcal.calibration.steps import called, design_line, run_all_draws
from radcal.proposals.design import design_points
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_runners
from radcal.storage.runs import IndexedRun, read_index, write_index
from radcal.targets.target import Targets

with job(snakemake) as case:
    runners = make_runners(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    (targets,) = map(Targets.read, snakemake.input.target)
    reused = [run.parameters for file in snakemake.input.reused for run in read_index(file)]
    points = design_points(case, snakemake.params.size, reused)
    _, part = snakemake.params.part
    first = part * case.design.chunk
    index = []
    for k, parameters in list(enumerate(points))[first : first + case.design.chunk]:
        with called(f"design run {k + 1} of {len(points)}"):
            (record,) = run_all_draws(case, runners, parameters)
        index.append(IndexedRun.of(record, parameters))
        progress(design_line(k + 1, len(points), record, targets))
    write_index(snakemake.output.index, index)

"""Simulate one chunk of the design."""

from radcal.calibration.steps import called, design_line, noise_seed, run_all_draws
from radcal.config import stages
from radcal.forecast.time_left import FINAL_RUNS, at_most, most_need
from radcal.proposals.design import design_points
from radcal.session.jobs import logged, progress
from radcal.simulators.sources import make_runner
from radcal.storage.run_index import IndexedRun, read_index, write_index
from radcal.targets.target import read_targets

with logged(snakemake.log[0], snakemake.params.case, snakemake.wildcards.at):
    case = stages.DesignChunk.model_validate(snakemake.params.case)
    runner = make_runner(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    targets = read_targets(snakemake.input.target)
    reused = [run.parameters for file in snakemake.input.reused for run in read_index(file)]
    points = design_points(case, snakemake.params.size, reused)
    first = int(snakemake.wildcards.chunk) * case.design.chunk
    index = []
    for k, parameters in list(enumerate(points))[first : first + case.design.chunk]:
        with called(f"design run {k + 1} of {len(points)}"):
            record = run_all_draws(case, runner, parameters)
        index.append(IndexedRun.of(record, parameters))
        missing = sum(not runner.is_recorded(x, noise_seed(case)) for x in points)
        most, size = snakemake.config["stop"]["max_runs"], snakemake.params.size
        further = missing - size + FINAL_RUNS
        usual = most_need(size, most) + further
        left = at_most(most + further, record.all_seconds, usual, " of simulation in this pass")
        progress(design_line(k + 1, len(points), record, targets) + left)
    write_index(snakemake.output.index, index)

"""Copy the runs of an earlier case that are also runs of this case."""

from radcal.calibration.reuse import reuse_runs
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_runners
from radcal.storage.runs import write_index

with job(snakemake) as case:
    runner, *_ = make_runners(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    taken = reuse_runs(case, runner, snakemake.params.earlier)
    write_index(snakemake.output.index, taken)
    progress(f"{len(taken)} runs reused from {snakemake.params.earlier}")

"""Simulate one of several proposals of an iteration."""

from radcal.calibration.steps import called, proposed, run_all_draws
from radcal.objectives.history import read_proposals
from radcal.session.jobs import job
from radcal.simulators.runner import make_runners
from radcal.storage.runs import IndexedRun, write_index

with job(snakemake) as case:
    runners = make_runners(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    k, j = int(snakemake.wildcards.k), int(snakemake.wildcards.j)
    index = []
    for proposals in read_proposals(snakemake.input.proposal)[j : j + 1]:  # the last iteration may have fewer
        parameters = proposed(case, proposals)
        with called(f"iteration {k}, infill run {j + 1}"):
            index += [IndexedRun.of(record, parameters) for record in run_all_draws(case, runners, parameters)]
    write_index(snakemake.output.index, index)

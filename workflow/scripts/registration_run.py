"""Simulate the laws that the measured image asks for: one run, onto which the image is registered again."""

from radcal.calibration.steps import all_parameters, called, run_all_draws
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_runners
from radcal.storage.records import read_json, understood
from radcal.storage.runs import IndexedRun, write_index

with job(snakemake) as case:
    runners = make_runners(case, snakemake.input.scene, [snakemake.input.geometry], snakemake.params.runs)
    with understood(snakemake.input.laws):
        parameters = all_parameters(case.materials, read_json(snakemake.input.laws))
    with called("registration run"):
        (record,) = run_all_draws(case, runners, parameters, image=True)
    write_index(snakemake.output.index, [IndexedRun.of(record, parameters)])
    progress(f"registration run, with laws fitted to the registered image: {record.draws_s:.1f} s")

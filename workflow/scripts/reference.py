"""Simulate the starting parameters: one run, which also tests the setup."""

from radcal.calibration.steps import reference_runs, repeatability
from radcal.image.model import Measurement
from radcal.programs.command_plan import changed_links
from radcal.session.jobs import job, progress
from radcal.simulators.declared_scale import check_scale
from radcal.simulators.runner import make_runners
from radcal.storage.runs import IndexedRun, write_index
from radcal.words import sentence

with job(snakemake) as case:
    runners = make_runners(case.at_start, snakemake.input.scene, [snakemake.input.geometry], snakemake.params.runs)
    first, *again = [record for (record,) in reference_runs(case, runners)]
    check_scale(first.image_db, Measurement.read(snakemake.input.measurement).image_db, case)
    differences = [first.largest_difference_db(record) for record in again]
    start = case.start_parameters
    repeated = [IndexedRun.of(record, start, db) for record, db in zip(again, differences, strict=True)]
    write_index(snakemake.output.index, [IndexedRun.of(first, start), *repeated])
    rows, columns = first.image_db.shape
    progress(f"reference run: {first.draws_s:.1f} s for an image of {rows} x {columns} pixels")
    for finding in repeatability(case.simulator, differences):
        progress(sentence(finding))
    if changed := changed_links(case, runners[0].identity):
        progress(changed)

"""Simulate the starting parameters: one run that shows whether everything is wired."""

from radcal.calibration.steps import reference_parameters, reference_runs, repeatability
from radcal.config import stages
from radcal.running.jobs import logged, progress
from radcal.simulators.sources import make_runner
from radcal.storage.records import write_json

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.ReferenceRun.model_validate(snakemake.params.case)
    runner = make_runner(case.at_start, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    first, *again = reference_runs(case, runner)
    differences = [first.largest_difference_db(record) for record in again]
    index = [{"key": record.key, "parameters": reference_parameters(case.materials)} for record in (first, *again)]
    for entry, difference in zip(index[1:], differences, strict=True):
        entry["difference_db"] = difference
    write_json(snakemake.output.index, index)
    progress(f"reference run: {first.seconds:.1f} s for {first.image_db.shape} pixels")
    if sentence := repeatability(case.simulator, differences):
        progress(sentence)

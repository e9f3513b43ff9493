"""Register the measured image onto the image of the reference run."""

from radcal.config import stages
from radcal.measurement.model import read_measurement
from radcal.measurement.registration import register, write_registered
from radcal.running.jobs import logged, progress
from radcal.storage.run_index import indexed

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Registration.model_validate(snakemake.params.case)
    measurement = read_measurement(snakemake.input.measurement)
    reference, _ = next(indexed([snakemake.input.reference], snakemake.params.runs, case.calibrated, image=True))
    if case.registration.method != "none":
        rows, columns = measurement.image_db.shape
        progress(f"registration of {rows} x {columns} pixels onto the reference run ...")
    registered = register(reference.image_db, measurement, case.registration)
    write_registered(snakemake.output.registered, registered)
    if registered.method != "none":
        progress(registered.verdict)

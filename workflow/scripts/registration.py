"""Register the measured image onto the image of the reference run or, the second time, onto the registration run."""

from radcal.config import stages
from radcal.measurement.model import read_measurement
from radcal.measurement.registration import read_registered, register, write_registered
from radcal.measurement.second_registration import register_again
from radcal.running.jobs import logged, progress
from radcal.storage.run_index import indexed

with logged(snakemake.log[0], snakemake.params.case, snakemake.wildcards.at):
    case = stages.Registration.model_validate(snakemake.params.case)
    run, _ = next(indexed([snakemake.input.onto], snakemake.params.runs, case.calibrated, image=True))
    rows, columns = run.image_db.shape
    if case.registration.method != "none":
        onto = "the run of the laws found" if snakemake.input.first else "the reference run"
        progress(f"registration of {rows} x {columns} pixels onto {onto} ...")
    if snakemake.input.first:
        registered = register_again(run.image_db, read_registered(snakemake.input.first[0]), case.registration)
    else:
        registered = register(run.image_db, read_measurement(snakemake.input.measurement), case.registration)
    write_registered(snakemake.output.registered, registered)
    if registered.method != "none":
        progress(registered.verdict)

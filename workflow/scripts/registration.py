"""Register the measured image onto the image of the reference run or, the second time, onto the registration run."""

from radcal.image.model import read_measurement
from radcal.radar.geometry import read_geometry
from radcal.registration.geometry_check import checked
from radcal.registration.registered import read_registered, register, register_again, write_registered
from radcal.scene.model import read_scene
from radcal.session.jobs import job, progress
from radcal.storage.run_index import indexed
from radcal.words import sentence

with job(snakemake) as case:
    run, _ = next(indexed([snakemake.input.onto], snakemake.params.runs, case.calibrated, image=True))
    rows, columns = run.image_db.shape
    if case.registration.method != "none":
        onto = "the registration run" if snakemake.input.first else "the reference run"
        progress(f"registration of {rows} x {columns} pixels onto {onto} ...")
    if snakemake.input.first:
        registered = register_again(run.image_db, read_registered(snakemake.input.first[0]), case.registration)
    else:
        registered = register(run.image_db, read_measurement(snakemake.input.measurement), case.registration)
        # read afterwards, because a registration takes more memory than a geometry
        geometry, scene = read_geometry(snakemake.input.geometry), read_scene(snakemake.input.scene)
        registered = checked(registered, run.image_db, geometry, case.radar, scene.slope_error_deg)
    write_registered(snakemake.output.registered, registered)
    if registered.method != "none":
        progress(registered.verdict)
    for finding in registered.findings if not snakemake.input.first else []:
        progress(sentence(finding))

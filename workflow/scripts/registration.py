"""Register the measured image onto the image of the reference run or, the second time, onto the registration run."""

from radcal.image.model import Measurement
from radcal.radar.geometry import read_geometry
from radcal.registration.geometry_check import checked
from radcal.registration.registered import Registered, register, register_again
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.storage.runs import indexed
from radcal.words import sentence

with job(snakemake) as case:
    run, _ = next(indexed([snakemake.input.onto], snakemake.params.runs, case.calibrated, image=True))
    rows, columns = run.image_db.shape
    if case.registration.method != "none":
        onto = "the registration run" if snakemake.input.first else "the reference run"
        progress(f"registration of {rows} x {columns} pixels onto {onto} ...")
    if snakemake.input.first:
        registered = register_again(run.image_db, Registered.read(snakemake.input.first[0]), case.registration)
    else:
        registered = register(run.image_db, Measurement.read(snakemake.input.measurement), case.registration)
        # read afterwards, because a registration takes more memory than a geometry
        geometry, scene = read_geometry(snakemake.input.geometry), Scene.read(snakemake.input.scene)
        registered = checked(registered, run.image_db, geometry, case.radar, scene.slope_error_deg)
    registered.write(snakemake.output.registered)
    if registered.method != "none":
        progress(registered.verdict)
    for finding in registered.findings if not snakemake.input.first else []:
        progress(sentence(finding))

"""Fit laws to the pixels of the measured image, without a simulator run, for a run to register the image onto again."""

from radcal.radar.geometry import read_geometry
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.session.jobs import job
from radcal.storage.records import write_json
from radcal.storage.runs import indexed
from radcal.targets.target_fit import laws_of_image

with job(snakemake) as case:
    reference, _ = next(indexed([snakemake.input.reference], snakemake.params.runs, case.calibrated, image=True))
    registered, geometry = Registered.read(snakemake.input.registered), read_geometry(snakemake.input.geometry)
    scene = Scene.read(snakemake.input.scene)
    laws = laws_of_image(case, geometry, registered, reference.image_db, scene)
    write_json(snakemake.output.laws, laws)

"""Write every run and iteration to ``calibration.h5``, all runs to the table ``runs.csv``, and the stop settings."""

from radcal.ground.one_incidence import bounces_on, bounces_outside
from radcal.objectives.history import read_search
from radcal.posterior.result import Image, Posterior
from radcal.products.tables import write_runs
from radcal.proposals.surrogate import Trainings
from radcal.radar.geometry import read_geometry
from radcal.registration.registered import Registered
from radcal.results.results import archive_of
from radcal.scene.model import Scene
from radcal.session.jobs import job
from radcal.storage.records import write_json, write_listing
from radcal.storage.runs import indexed
from radcal.targets.target import Targets

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    targets = [Targets.read(path) for path in snakemake.input.target]
    geometry = read_geometry(snakemake.input.geometry[0])
    runs = snakemake.params.runs
    final = [record for record, _ in indexed([snakemake.input.final], runs, case.calibrated)]
    images = [Registered.read(path) for path in snakemake.input.registered]
    each = [Posterior.read(path) for path in snakemake.input.posterior]
    image, scene = Image.read(snakemake.input.image), Scene.read(snakemake.input.scene)
    trained = {name: one for path in snakemake.input.trained for name, one in Trainings.read(path).materials.items()}
    noted = bounces_outside([bounces_on(read_geometry(path), targets[0]) for path in snakemake.input.geometry])
    archive = archive_of(case, history, scene, geometry, images, targets, runs, final, each, image, trained, noted)
    archive.write(snakemake.output.archive)
    write_runs(snakemake.output.table, archive)
    write_listing(snakemake.output.checksum, [snakemake.output.table])
    write_json(snakemake.output.stop, case.stop.model_dump())

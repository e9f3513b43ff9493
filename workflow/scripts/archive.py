"""Write all results to ``calibration.h5``, all runs to ``runs.csv``, the stop settings, and the folder ``export``."""

from radcal.ground.one_incidence import bounces_on, bounces_outside
from radcal.objectives.history import read_search
from radcal.posterior.result import Image, Posterior
from radcal.products.export import write_export
from radcal.products.tables import write_runs
from radcal.proposals.surrogate import Trainings
from radcal.radar.geometry import read_geometry
from radcal.registration.registered import Registered
from radcal.results.results import archive_of
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_simulator
from radcal.storage.records import write_json, write_listing
from radcal.storage.runs import indexed
from radcal.targets.target import Targets

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    targets = [Targets.read(path) for path in snakemake.input.target]
    geometries = [read_geometry(path) for path in snakemake.input.geometry]
    runs, index = snakemake.params.runs, snakemake.input.final
    final = [record for record, _ in indexed([index], runs, case.calibrated)]
    images = [Registered.read(path) for path in snakemake.input.registered]
    each = [Posterior.read(path) for path in snakemake.input.posterior]
    image, scene = Image.read(snakemake.input.image), Scene.read(snakemake.input.scene)
    trained = {name: one for path in snakemake.input.trained for name, one in Trainings.read(path).materials.items()}
    noted = bounces_outside([bounces_on(geometry, targets[0]) for geometry in geometries])
    archive = archive_of(case, history, scene, geometries[0], images, targets, runs, final, each, image, trained, noted)
    archive.write(snakemake.output.archive)
    write_runs(snakemake.output.table, archive)
    write_listing(snakemake.output.checksum, [snakemake.output.table])
    write_json(snakemake.output.stop, case.stop.model_dump())
    external = case.simulator.only_parameters  # whose own input is exported
    simulator = make_simulator(case, geometries[0], snakemake.input.geometry[0]) if external else None
    files = write_export(snakemake.output.folder, case, archive, scene, geometries, images, index, runs, simulator)
    write_listing(snakemake.output.exported, files)
    progress(f"export: {snakemake.output.folder}")

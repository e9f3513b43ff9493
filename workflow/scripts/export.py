"""Write tables, calibrated materials and images for other programs, from the archive."""

from radcal.products.export import write_export
from radcal.radar.geometry import read_geometry
from radcal.registration.registered import Registered
from radcal.results.archive import read_archive
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_simulator
from radcal.storage.records import write_listing

with job(snakemake) as case:
    scene = Scene.read(snakemake.input.scene)
    geometries = [read_geometry(path) for path in snakemake.input.geometry]
    archive = read_archive(snakemake.input.archive)
    registered = [Registered.read(path) for path in snakemake.input.registered]
    final, runs = snakemake.input.final, snakemake.params.runs
    external = case.simulator.only_parameters  # whose own input is exported
    simulator = make_simulator(case, geometries[0], snakemake.input.geometry[0]) if external else None
    folder = snakemake.output.folder
    files = write_export(folder, case, archive, scene, geometries, registered, final, runs, simulator)
    write_listing(snakemake.output.checksums, files)
    progress(f"export: {folder}")

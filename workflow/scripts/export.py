"""Write tables, calibrated materials and images for other programs, from the archive."""

from radcal.products.export import pass_images, write_export
from radcal.radar.geometry import read_geometry
from radcal.registration.registered import read_registered
from radcal.results.archive import read_archive
from radcal.scene.model import read_scene
from radcal.session.jobs import job, progress
from radcal.simulators.sources import make_simulator
from radcal.storage.listing import write_listing
from radcal.targets.target import read_targets

with job(snakemake) as case:
    scene, geometries = read_scene(snakemake.input.scene), [read_geometry(path) for path in snakemake.input.geometry]
    archive = read_archive(snakemake.input.archive)
    registered = [read_registered(path) for path in snakemake.input.registered]
    levels = [one.levels for one in read_targets(*snakemake.input.target).passes]
    final, runs = snakemake.input.final, snakemake.params.runs
    images = pass_images(case, archive, geometries, registered, levels, final, runs)
    external = case.simulator.only_parameters  # whose own input is exported
    simulator = make_simulator(case, geometries[0], snakemake.input.geometry[0]) if external else None
    files = write_export(snakemake.output.folder, case, archive, scene, images, simulator)
    write_listing(snakemake.output.checksums, files)
    progress(f"export: {snakemake.output.folder}")

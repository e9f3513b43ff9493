"""Write tables, calibrated materials and images for other programs, from the archive."""

from radcal.config import stages
from radcal.radar.geometry import read_geometry
from radcal.report.archive import read_archive
from radcal.report.export import write_export
from radcal.running.jobs import logged, progress
from radcal.scene.model import read_scene
from radcal.storage.listing import write_listing

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Export.model_validate(snakemake.params.case)
    scene, geometry = read_scene(snakemake.input.scene), read_geometry(snakemake.input.geometry[0])
    archive = read_archive(snakemake.input.archive)
    files = write_export(snakemake.output.folder, case, archive, scene, geometry)
    write_listing(snakemake.output.checksums, files)
    progress(f"export: {snakemake.output.folder}")

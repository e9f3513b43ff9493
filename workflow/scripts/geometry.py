"""Compute the geometry of the pass, or join it from its strips."""

from radcal.radar.geometry import joined, read_geometry, write_geometry
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress

with job(snakemake) as case:
    if snakemake.input.strips:
        geometry = joined([read_geometry(path) for path in snakemake.input.strips])
    else:
        geometry = make_geometry(Scene.read(snakemake.input.scene), case.radar)
    write_geometry(snakemake.output.geometry, geometry, case.radar, snakemake.params.immaterial)
    progress(f"geometry: image of {geometry.shape[0]} x {geometry.shape[1]} pixels")

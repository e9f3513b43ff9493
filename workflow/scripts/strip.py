"""Compute the geometry of a strip of the pass."""

from radcal.radar.geometry import Frame, write_geometry
from radcal.radar.projection import make_geometry, strips_of
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.storage.records import read_json

with job(snakemake) as case:
    scene, frame = Scene.read(snakemake.input.scene), Frame(**read_json(snakemake.input.frame))
    strips = strips_of(len(scene.material), scene.cell_m, case.radar, snakemake.params.strips, frame)
    strip = strips[int(snakemake.wildcards.s)]
    write_geometry(snakemake.output.strip, make_geometry(scene, case.radar, strip=strip), case.radar)
    progress(f"strip {snakemake.wildcards.s}: columns {strip.first} to {strip.last - 1} of {strip.columns}")

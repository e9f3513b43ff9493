"""Compute what all strips of the pass share."""

from dataclasses import asdict

from radcal.radar.projection import make_frame
from radcal.scene.model import read_scene
from radcal.session.jobs import job
from radcal.storage.records import write_json

with job(snakemake) as case:
    write_json(snakemake.output.frame, asdict(make_frame(read_scene(snakemake.input.scene), case.radar)))

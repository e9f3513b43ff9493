"""Compute what all strips of the pass share."""

from dataclasses import asdict

from radcal.radar.projection import make_frame
from radcal.scene.model import scene_on_disk
from radcal.session.jobs import job
from radcal.storage.records import write_json

with job(snakemake) as case, scene_on_disk(snakemake.input.scene) as scene:
    write_json(snakemake.output.frame, asdict(make_frame(scene, case.radar)))

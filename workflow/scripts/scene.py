"""Build the scene."""

from radcal.scene.sources import make_scene
from radcal.session.jobs import job, progress
from radcal.words import sentence

with job(snakemake) as case:
    scene = make_scene(case.scene, list(case.materials), snakemake.params.get("heading_deg", 0.0))
    scene.write(snakemake.output.scene)
    progress(f"scene: {scene.material.shape[0]} x {scene.material.shape[1]} cells, {len(case.materials)} materials")
    for finding in scene.findings:
        progress(sentence(finding))

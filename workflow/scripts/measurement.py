"""Read or make the measured image and check it against the scene."""

from radcal.measurement.sources import make_measurement
from radcal.radar.geometry import read_geometry
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_simulator
from radcal.words import sentence

with job(snakemake) as case:
    scene = Scene.read(snakemake.input.scene)
    geometry = read_geometry(snakemake.input.geometry)
    simulator = make_simulator(case, geometry, snakemake.input.geometry, scene)
    measurement = make_measurement(case, geometry, simulator, scene, partly=snakemake.wildcards.p != "1")
    measurement.write(snakemake.output.measurement)
    progress(f"measured image: {measurement.source}")
    for finding in measurement.findings:
        progress(sentence(finding))

"""Write the simulator's identity."""

from radcal.config.disclosure import disclosed
from radcal.radar.geometry import read_geometry
from radcal.sections.simulator import SIMULATORS
from radcal.session.jobs import job
from radcal.simulators.runner import make_simulator
from radcal.storage.records import write_json

with job(snakemake) as case:
    simulator = make_simulator(case, read_geometry(snakemake.input.geometry), snakemake.input.geometry)
    identity = {**disclosed(simulator.identity), **SIMULATORS.origin(case.simulator.kind)}
    write_json(snakemake.output.identity, identity)

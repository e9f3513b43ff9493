"""Write the simulator's identity."""

from radcal.config.disclosure import disclosed
from radcal.radar.geometry import read_geometry
from radcal.sections.simulator import SIMULATORS
from radcal.session.jobs import job
from radcal.simulators.sources import make_simulator
from radcal.storage.files import case_folder
from radcal.storage.records import write_json

with job(snakemake) as case:
    simulator = make_simulator(case, read_geometry(snakemake.input.geometry), snakemake.input.geometry)
    # the width of seeds is not part of the identity; it is kept here for the next command
    identity = {
        **disclosed(simulator.identity),
        **SIMULATORS.origin(case.simulator.kind),
        "seed_bits": case.simulator.seed_bits,
    }
    write_json(snakemake.output.identity, identity)
    # of an earlier version of radcal, whose number of bits was needed until now
    case_folder(snakemake.output.identity).joinpath("simulator.json").unlink(missing_ok=True)

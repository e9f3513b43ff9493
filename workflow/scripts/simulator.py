"""Write what the simulator's runs are known by."""

from radcal.calibration.steps import make_simulator
from radcal.config import Case
from radcal.files import write_json
from radcal.jobs import logged

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    write_json(snakemake.output.identity, dict(make_simulator(case, snakemake.input.geometry).identity))

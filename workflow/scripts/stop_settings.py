"""Write the stop settings, so that changing them touches nothing but what reads this file."""

from radcal.config import Case
from radcal.files import write_json
from radcal.jobs import logged

with logged(snakemake.log[0]):
    write_json(snakemake.output.stop, Case.of_sections(snakemake.params.case).stop.model_dump())

"""Write the stop settings to a file, so that a change of them affects only the readers of this file."""

from radcal.config import stages
from radcal.session.jobs import logged
from radcal.storage.records import write_json

with logged(snakemake.log[0], snakemake.params.case):
    write_json(snakemake.output.stop, stages.StopSettings.model_validate(snakemake.params.case).stop.model_dump())

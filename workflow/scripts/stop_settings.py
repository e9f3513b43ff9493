"""Write the stop settings to a file, so that a change of them affects only the readers of this file."""

from radcal.session.jobs import job
from radcal.storage.records import write_json

with job(snakemake) as case:
    write_json(snakemake.output.stop, case.stop.model_dump())

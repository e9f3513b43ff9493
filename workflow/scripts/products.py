"""Simulate products with the calibrated laws, and with draws from their posterior."""

from radcal.products.applied import made_with
from radcal.results.archive import read_archive
from radcal.session.jobs import job, progress
from radcal.storage.records import write_json

with job(snakemake) as case:
    archive = read_archive(snakemake.input.archive, images=False)
    for line in made_with(archive, case, snakemake.params.folder, snakemake.params.runs):
        progress(line)
    write_json(snakemake.output.made, case.products.model_dump(mode="json"))

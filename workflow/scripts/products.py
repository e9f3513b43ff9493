"""Simulate products with the calibrated laws, and with draws from their posterior."""

from radcal.products.applied import made_with
from radcal.results.archive import read_archive
from radcal.session.jobs import job, progress

with job(snakemake) as case:
    archive = read_archive(snakemake.input.archive, images=False)
    for line in made_with(archive, case, snakemake.output.folder, snakemake.params.runs):
        progress(line)

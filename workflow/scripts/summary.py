"""Write ``summary.json``, and print how the calibration ended."""

from radcal.results.archive import read_archive
from radcal.results.summary import numbered_jobs, sentences, summarise, wall_seconds
from radcal.session.jobs import job, progress
from radcal.storage.records import write_json

with job(snakemake):
    archive = read_archive(snakemake.input.archive, images=False)
    summary = summarise(archive, wall_seconds(snakemake.params.benchmarks, numbered_jobs(archive)))
    write_json(snakemake.output.summary, summary, flat=True)
    for sentence in sentences(archive):
        progress(sentence)

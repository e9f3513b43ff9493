"""Write the summary, and print how the calibration ended."""

from radcal.jobs import logged, progress
from radcal.records import write_json
from radcal.report.summary import numbered_jobs, sentences, summarise, wall_seconds

with logged(snakemake.log[0]):
    archive = snakemake.input.archive
    summary = summarise(archive, wall_seconds(snakemake.params.benchmarks, numbered_jobs(archive)))
    write_json(snakemake.output.summary, summary, flat=True)
    for sentence in sentences(archive):
        progress(sentence)

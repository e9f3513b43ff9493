"""Write the summary and say how the calibration ended."""

from radcal.files import write_json
from radcal.jobs import logged, progress
from radcal.report.summary import sentences, summarise, wall_seconds

with logged(snakemake.log[0]):
    summary = summarise(snakemake.input.archive, wall_seconds(snakemake.params.benchmarks))
    write_json(snakemake.output.summary, summary)
    for sentence in sentences(snakemake.input.archive):
        progress(sentence)

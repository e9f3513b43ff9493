"""Draw the figures and write the report, from the archive alone."""

from radcal.jobs import logged, progress
from radcal.report.figures import write_figures
from radcal.report.html import write_report

with logged(snakemake.log[0]):
    figures = write_figures(snakemake.input.archive, snakemake.output.figures)
    write_report(snakemake.output.page, snakemake.input.archive, figures)
    progress(f"report: {snakemake.output.page}")

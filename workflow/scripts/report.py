"""Draw the figures, write the report and ``summary.json`` from the archive, and print how the calibration ended."""

import os
from pathlib import Path

from radcal.figures.figures import write_figures
from radcal.page.html import provenance_of, write_report
from radcal.results.archive import read_archive
from radcal.results.summary import sentences, summarise
from radcal.session.jobs import COMMAND, job, progress
from radcal.storage.records import write_json, write_listing

with job(snakemake):
    archive = read_archive(snakemake.input.archive)
    progress("report: figures are drawn ...")
    figures = write_figures(archive, snakemake.output.figures)
    made = provenance_of(archive, Path(snakemake.output.page).parent, os.environ.get(COMMAND, ""))
    write_report(snakemake.output.page, archive, figures, made)
    pictures = [path for figure in figures for path in (figure.png, figure.pdf)]
    write_listing(snakemake.output.checksums, [snakemake.output.page, *pictures])
    progress(f"report: {snakemake.output.page}")
    write_json(snakemake.output.summary, summarise(archive, made["seconds"]), flat=True)
    for sentence in sentences(archive):
        progress(sentence)

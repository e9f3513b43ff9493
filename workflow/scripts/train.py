"""Train the surrogates of iteration k."""

from radcal.calibration.history import read_runs
from radcal.calibration.steps import train_all
from radcal.calibration.surrogate import read_surrogates, write_surrogates
from radcal.config import stages
from radcal.running.jobs import logged

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Train.model_validate(snakemake.params.case)
    history = read_runs([snakemake.input.scores, *snakemake.input.verified])
    previous = read_surrogates(snakemake.input.previous) if snakemake.input.previous else None
    surrogates = train_all(history, case, int(snakemake.wildcards.k), previous, snakemake.threads)
    write_surrogates(snakemake.output.surrogate, surrogates)

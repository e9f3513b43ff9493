"""Train the surrogates of all calibrated materials."""

from radcal.calibration.history import read_runs
from radcal.calibration.objectives import make_objectives
from radcal.calibration.steps import train_all
from radcal.calibration.surrogate import write_trainings
from radcal.config import stages
from radcal.measurement.target import read_targets
from radcal.running.jobs import logged

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Train.model_validate(snakemake.params.case)
    history = read_runs([snakemake.input.scores, *snakemake.input.verified])
    objectives = make_objectives(case, read_targets(*snakemake.input.target))
    trainings = train_all(history, case, objectives, snakemake.threads)
    write_trainings(snakemake.output.surrogate, trainings)

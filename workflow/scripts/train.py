"""Train the surrogates of all calibrated materials, except those that the verification before has trained."""

from radcal.calibration.steps import train_all
from radcal.objectives import make_objectives
from radcal.objectives.history import read_search
from radcal.proposals.surrogate import read_trainings, write_trainings
from radcal.session.jobs import job
from radcal.targets.target import read_targets

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    objectives = make_objectives(case, read_targets(snakemake.input.target))
    trained = {name: one for path in snakemake.input.trained for name, one in read_trainings(path).items()}
    trainings = train_all(history, case, objectives, snakemake.threads, trained)
    write_trainings(snakemake.output.surrogate, trainings)

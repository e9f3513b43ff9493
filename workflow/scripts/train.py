"""Train the surrogates of all calibrated materials, except those that the verification before has trained."""

from radcal.calibration.steps import train_all
from radcal.objectives import make_objectives
from radcal.objectives.history import read_search
from radcal.proposals.surrogate import Trainings
from radcal.session.jobs import job
from radcal.targets.target import Targets

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    objectives = make_objectives(case, [Targets.read(path) for path in snakemake.input.target])
    trained = {name: one for path in snakemake.input.trained for name, one in Trainings.read(path).materials.items()}
    trainings = train_all(history, case, objectives, snakemake.threads, trained)
    Trainings(trainings).write(snakemake.output.surrogate)

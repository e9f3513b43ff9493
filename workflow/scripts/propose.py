"""Propose the next parameters of every material whose search has not ended."""

from radcal.calibration.steps import propose_all
from radcal.config import Stop
from radcal.objectives import make_objectives
from radcal.objectives.history import read_search, write_proposals
from radcal.proposals.surrogate import Trainings
from radcal.session.jobs import job
from radcal.targets.target import Targets

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    objectives = make_objectives(case, [Targets.read(path) for path in snakemake.input.target])
    stop = Stop.model_validate(snakemake.config["stop"])
    trainings = Trainings.read(snakemake.input.surrogate).materials
    k = int(snakemake.wildcards.k)
    proposals = propose_all(trainings, objectives, history, case, k, stop, snakemake.threads)
    write_proposals(snakemake.output.proposal, proposals)

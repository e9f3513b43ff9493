"""Propose the next parameters of every material whose search has not ended."""

from radcal.calibration.steps import propose_all
from radcal.config import Stop, stages
from radcal.objectives import make_objectives
from radcal.objectives.history import read_runs, write_proposals
from radcal.proposals.surrogate import read_trainings
from radcal.session.jobs import logged
from radcal.targets.target import read_targets

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Propose.model_validate(snakemake.params.case)
    history = read_runs([snakemake.input.scores, *snakemake.input.verified])
    objectives = make_objectives(case, read_targets(*snakemake.input.target))
    stop = Stop.model_validate(snakemake.config["stop"])
    trainings = read_trainings(snakemake.input.surrogate)
    k = int(snakemake.wildcards.k)
    proposals = propose_all(trainings, objectives, history, case, k, stop, snakemake.threads)
    write_proposals(snakemake.output.proposal, proposals)

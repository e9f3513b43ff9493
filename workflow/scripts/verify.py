"""Simulate the proposals of all materials and score their runs, which other jobs may have made already."""

from radcal.calibration.steps import progress_line, verify
from radcal.config import Stop
from radcal.objectives import make_objectives
from radcal.objectives.history import History, read_proposals, read_search, write_runs
from radcal.proposals.surrogate import Trainings
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_runners
from radcal.targets.target import Targets

with job(snakemake) as case:
    runners = make_runners(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    proposals = read_proposals(snakemake.input.proposal)
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    targets, k = [Targets.read(path) for path in snakemake.input.target], int(snakemake.wildcards.k)
    objectives = make_objectives(case, targets)
    runs, trained = verify(proposals, targets, objectives, runners, case, history, k, snakemake.threads)
    Trainings(trained).write(snakemake.output.trained)
    write_runs(snakemake.output.verified, runs)
    stop = Stop.model_validate(snakemake.config["stop"])
    history = History([*history.runs, *runs])
    progress(progress_line(history, case.calibrated, stop, case.objective))

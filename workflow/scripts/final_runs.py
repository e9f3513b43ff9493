"""Simulate the best parameters of all materials in one run, and in a second run with another noise seed."""

from radcal.calibration.steps import all_parameters, called, noise_seed, not_fresh
from radcal.objectives.history import read_search
from radcal.session.jobs import job, progress
from radcal.simulators.runner import make_runners
from radcal.storage.runs import IndexedRun, write_index
from radcal.words import sentence

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    runners = make_runners(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    parameters = all_parameters(case.materials, {name: history.best(name).parameters for name in case.calibrated})
    # with one calibrated material the first of these runs is in the run store already; its whole image is not needed
    with called("final runs"):
        records = [
            one.run(parameters, noise_seed(case, fresh), image=fresh) for one in runners for fresh in (False, True)
        ]
    write_index(snakemake.output.final, [IndexedRun(record.key, parameters) for record in records])
    progress("final runs: the calibrated laws of all materials, and the same run with another seed")
    for finding in not_fresh(case.simulator, records[:2]):
        progress(sentence(finding))

# The loop: train(k), propose(k), verify(k), and on to k + 1 until the stop settings are met.

from functools import cache
from pathlib import Path

from snakemake.exceptions import IncompleteCheckpointException
from snakemake.io import checkpoint_target

from radcal.objectives.history import History, read_runs
from radcal.calibration.stopping import decide


wildcard_constraints:
    k="[0-9]+",
    j="[0-9]+",


def verification(k):
    """Outputs of the verification of iteration k; an exception makes Snakemake make missing ones."""
    try:
        return checkpoints.verify.get(k=k).output
    except IncompleteCheckpointException as unfinished:
        # Snakemake itself asks for the first output alone, and makes nothing if only the other one is missing
        names = expand(every_pass(rules.verify.output), k=k)
        unfinished.targetfile = [checkpoint_target(name) for name in names]
        raise


# Several rules ask for the iterations, and again after each one: a file is read once, and a decision made once. A file
# that is made again has another time.
@cache
def runs_of(path, time_ns):
    """Scored runs of a file of this time."""
    return read_runs([path]).runs


@cache
def ends_with(*made):
    """Whether the search ends with the runs of files, given with their times."""
    history = History(run for one in made for run in runs_of(*one))
    return decide(history, CASE.calibrated, CASE.stop, CASE.objective).ended


# New stop settings affect only `verified` and the archive: the jobs of the loop read the settings from Snakemake's
# config, so that no finished job of the loop runs again.
def verified(wildcards):
    """Files of the verified iterations until the search ends; an exception makes Snakemake make a missing file."""
    files, made = [checkpoints.scores.get().output.scores], []
    while True:
        made.append((str(files[-1]), Path(files[-1]).stat().st_mtime_ns))
        if ends_with(*made):
            return files[1:]
        files.append(verification(len(files) - 1).verified)


def trained_last(wildcards):
    """Surrogates that the last verification has trained, by all runs; none without an iteration."""
    return (
        [f"{OUT}/iterations/{len(found) - 1}/verified/surrogate.h5"]
        if (found := verified(wildcards))
        else []
    )


def verified_before(wildcards):
    """Verified proposals of the iteration before, which needs those before it; none in the first iteration."""
    k = int(wildcards.k)
    return [f"{OUT}/iterations/{k - 1}/verified.json"] if k else []


def trained_before(wildcards):
    """Surrogates that the verification of the iteration before has trained; none in the first iteration."""
    k = int(wildcards.k)
    return [f"{OUT}/iterations/{k - 1}/verified/surrogate.h5"] if k else []


# Where a profile groups jobs, as on a cluster, an iteration is one job. Several runs of an iteration are jobs of their
# own, on any nodes; what comes before and after them is then a job each.
def iteration(wildcards):
    """Group of the jobs of an iteration; none if no profile groups jobs."""
    return "iteration" if workflow.group_settings.overwrite_groups else None


WITH_RUNS = None if STAGES["infill_run"].is_needed(CASE) else iteration


rule train:
    input:
        scores=f"{OUT}/scores.json",
        verified=verified_before,
        trained=trained_before,
        target=every_pass(rules.target.output.target),
    output:
        **outputs("train", surrogate=update),
    log:
        f"{OUT}/logs/iterations/{{k}}/train.log",
    benchmark:
        f"{OUT}/benchmarks/train_{{k}}.tsv"
    retries: 0
    group:
        iteration
    threads: len(CASE.calibrated)
    resources:
        **resources("train"),
    params:
        case=STAGES["train"].params(CASE),
    message:
        words("train")
    script:
        "../scripts/train.py"


rule propose:
    input:
        scores=f"{OUT}/scores.json",
        verified=verified_before,
        target=every_pass(rules.target.output.target),
        surrogate=rules.train.output.surrogate,
    output:
        **outputs("propose"),
    log:
        f"{OUT}/logs/iterations/{{k}}/propose.log",
    benchmark:
        f"{OUT}/benchmarks/propose_{{k}}.tsv"
    retries: 0
    group:
        iteration
    threads: len(CASE.calibrated)
    resources:
        **resources("propose"),
    params:
        case=STAGES["propose"].params(CASE),
    message:
        words("propose")
    script:
        "../scripts/propose.py"


# The runs of an iteration of several proposals, side by side; verify then finds them in the run store.
rule infill_run:
    input:
        every_pass(SIMULATOR),
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        proposal=rules.propose.output.proposal,
    output:
        **outputs("infill_run"),
    log:
        f"{OUT}/logs/iterations/{{k}}/runs/{{j}}.log",
    benchmark:
        f"{OUT}/benchmarks/iterations/{{k}}/infill_run_{{j}}.tsv"
    resources:
        **resources("infill_run", runs=len(PASSES)),
    params:
        case=STAGES["infill_run"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        words("infill_run")
    script:
        "../scripts/infill_run.py"


SIDE_BY_SIDE = (
    expand(
        rules.infill_run.output.index, j=range(CASE.infill.batch), allow_missing=True
    )
    if STAGES["infill_run"].is_needed(CASE)
    else []
)


checkpoint verify:
    input:
        every_pass(SIMULATOR),
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        verified=verified_before,
        proposal=rules.propose.output.proposal,
        made=SIDE_BY_SIDE,
    output:
        **outputs("verify", trained=update),
    log:
        f"{OUT}/logs/iterations/{{k}}/verify.log",
    benchmark:
        f"{OUT}/benchmarks/verify_{{k}}.tsv"
    group:
        WITH_RUNS
    resources:
        **resources("verify", runs=len(PASSES)),
    params:
        case=STAGES["verify"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        words("verify")
    script:
        "../scripts/verify.py"

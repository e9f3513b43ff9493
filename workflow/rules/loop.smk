# The loop: train(k), propose(k), verify(k), and on to k + 1 until the stop settings are met.

from snakemake.exceptions import IncompleteCheckpointException
from snakemake.io import checkpoint_target

from radcal.objectives.history import read_runs
from radcal.calibration.stopping import decide


wildcard_constraints:
    k="[0-9]+",


def verification(k):
    """Outputs of the verification of iteration k; an exception makes Snakemake make missing ones."""
    try:
        return checkpoints.verify.get(k=k).output
    except IncompleteCheckpointException as unfinished:
        # Snakemake itself asks for the first output alone, and makes nothing if only the other one is missing
        names = expand(every_pass(rules.verify.output), k=k)
        unfinished.targetfile = [checkpoint_target(name) for name in names]
        raise


def verified(wildcards):
    """Files of the verified iterations until the search ends; an exception makes Snakemake make a missing file."""
    files = [checkpoints.scores.get().output.scores]
    k = 0
    while not decide(
        read_runs(files), CASE.calibrated, CASE.stop, CASE.objective
    ).ended:
        files.append(verification(k).verified)
        k += 1
    return files[1:]


def trained_last(wildcards):
    """Surrogates that the last verification has trained, by all runs; none without an iteration."""
    return (
        [f"{OUT}/iterations/{len(found) - 1}/verified/surrogate.h5"]
        if (found := verified(wildcards))
        else []
    )


def earlier(wildcards):
    """Files of the verified proposals before this iteration."""
    return [f"{OUT}/iterations/{j}/verified.json" for j in range(int(wildcards.k))]


# New stop settings affect only `verified` above and the readers of stop.json. The jobs of the loop read the settings
# from Snakemake's config, so that no finished job runs again.
rule stop_settings:
    output:
        **outputs("stop_settings"),
    log:
        f"{OUT}/logs/stop_settings.log",
    retries: 0
    params:
        case=STAGES["stop_settings"].params(CASE),
    message:
        words("stop_settings")
    script:
        "../scripts/stop_settings.py"


def trained_before(wildcards):
    """Surrogates that the verification of the iteration before has trained; none in the first iteration."""
    k = int(wildcards.k)
    return [f"{OUT}/iterations/{k - 1}/verified/surrogate.h5"] if k else []


rule train:
    input:
        scores=f"{OUT}/scores.json",
        verified=earlier,
        trained=trained_before,
        target=every_pass(rules.target.output.target),
    output:
        **outputs("train", surrogate=update),
    log:
        f"{OUT}/logs/iterations/{{k}}/train.log",
    benchmark:
        f"{OUT}/benchmarks/train_{{k}}.tsv"
    retries: 0
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
        verified=earlier,
        target=every_pass(rules.target.output.target),
        surrogate=rules.train.output.surrogate,
    output:
        **outputs("propose"),
    log:
        f"{OUT}/logs/iterations/{{k}}/propose.log",
    benchmark:
        f"{OUT}/benchmarks/propose_{{k}}.tsv"
    retries: 0
    threads: len(CASE.calibrated)
    resources:
        **resources("propose"),
    params:
        case=STAGES["propose"].params(CASE),
    message:
        words("propose")
    script:
        "../scripts/propose.py"


checkpoint verify:
    input:
        every_pass(SIMULATOR),
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        earlier=earlier,
        proposal=rules.propose.output.proposal,
    output:
        **outputs("verify", trained=update),
    log:
        f"{OUT}/logs/iterations/{{k}}/verify.log",
    benchmark:
        f"{OUT}/benchmarks/verify_{{k}}.tsv"
    resources:
        **resources("verify", runs=len(PASSES)),
    params:
        case=STAGES["verify"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        words("verify")
    script:
        "../scripts/verify.py"

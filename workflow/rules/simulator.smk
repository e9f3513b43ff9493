# The simulator's identity, and the resources that its runs request from a cluster.


def synthetic(wildcards):
    """Whether the simulator makes the measured image of a pass."""
    return PASSES[int(wildcards.p)].measurement.source == "synthetic"


# A new build or setting of an external simulator is another simulator. Every job that simulates has simulator.json as
# input, never as ancient(). The simulator's sources as inputs would not be enough: if the job of an ancient() input
# runs, Snakemake does not check whether the following job must run, too.
rule simulator:
    input:
        [FILES[key] for key in FILES if key.startswith("simulator.")],
        geometry=rules.geometry.output.geometry,
    output:
        **outputs("simulator", identity=update),
    log:
        f"{OUT}/logs/passes/{{p}}/simulator.log",
    retries: 0
    resources:
        **resources("simulator"),
    params:
        case=of_pass("simulator"),
    message:
        words("simulator")
    script:
        "../scripts/simulator.py"


# radcal's own simulator has no files or settings that change its numbers, so that its jobs need no simulator.json
SIMULATOR = (
    [rules.simulator.output.identity] if STAGES["simulator"].is_needed(CASE) else []
)

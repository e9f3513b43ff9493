# The simulator: what it is, and what its runs ask of a cluster.

SYNTHETIC = CASE.measurement.source == "synthetic"


# A new build or setting of an external simulator is another simulator: every job that simulates takes this
# file, never as ancient(). Its sources as their inputs would not do: a job behind an ancient() input whose own
# job runs is not asked for reasons of its own.
rule simulator:
    input:
        [FILES[key] for key in FILES if key.startswith("simulator.")],
        geometry=rules.geometry.output.geometry,
    output:
        identity=update(f"{OUT}/simulator.json"),
    log:
        f"{OUT}/logs/simulator.log",
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run"),
    params:
        case=STAGES["simulator"].params(CASE),
    message:
        "simulator"
    script:
        "../scripts/simulator.py"


# radcal's own has neither files nor settings that change its numbers: a job saved
SIMULATOR = (
    [rules.simulator.output.identity] if CASE.simulator.kind == "command" else []
)

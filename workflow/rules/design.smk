# The reference run and the initial design. Runs are kept in the run store, where every job looks first; the outputs
# below only list runs of the store, and a job that runs again finds its runs in the store.
# Measurement and target are inputs, so that a mistake in them is found before any run. They are not ancient(): if the
# job of an ancient() input runs, Snakemake does not check whether the following job must run, too, so that the old
# design would remain after a change of the seed, which also changes the target.

CHUNKS = range(-(-CASE.design_size // CASE.design.chunk))
EARLIER = f"{OUT.parent}/{CASE.design.reuse}/runs" if CASE.design.reuse else None
# Without an earlier case the rule needs nothing, so that its job says at once that the case is not named.
FOR_REUSE = {
    "simulator": every_pass(SIMULATOR),
    "scene": rules.scene.output.scene,
    "geometry": f"{OUT}/geometry.h5",
    "measurement": f"{OUT}/measurement.h5",
}


# Runs copied from an earlier case. This rule comes before the reference run, which may be one of the copied runs.
rule reuse:
    input:
        **(FOR_REUSE if CASE.design.reuse else {}),
    output:
        index=f"{OUT}/reused.json",
    log:
        f"{OUT}/logs/reuse.log",
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run"),
    params:
        case=STAGES["reuse"].params(CASE),
        runs=f"{OUT}/runs",
        earlier=EARLIER,
    message:
        "runs of an earlier case"
    script:
        "../scripts/reuse.py"


REUSED = [rules.reuse.output.index] if CASE.design.reuse else []
REGISTRATION_RUN = (
    every_pass(rules.registration_run.output.index) if REGISTERED_TWICE else []
)


rule reference_run:
    input:
        SIMULATOR,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        measurement=rules.measurement.output.measurement,
        reused=REUSED,
    output:
        index=f"{OUT}/{{at}}reference.json",
    log:
        f"{OUT}/logs/{{at}}reference.log",
    benchmark:
        f"{OUT}/benchmarks/{{at}}reference.tsv"
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run", 2),
    params:
        case=of_pass("reference_run"),
        runs=f"{OUT}/runs",
    message:
        "reference run"
    script:
        "../scripts/reference.py"


rule design_chunk:
    input:
        SIMULATOR,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        target=rules.target.output.target,
        reused=REUSED,
    output:
        index=f"{OUT}/{{at}}design/{{chunk}}.json",
    log:
        f"{OUT}/logs/{{at}}design/{{chunk}}.log",
    benchmark:
        f"{OUT}/benchmarks/{{at}}design_{{chunk}}.tsv"
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run", CASE.design.chunk),
    params:
        case=of_pass("design_chunk"),
        size=CASE.design_size,
        runs=f"{OUT}/runs",
    message:
        "design, chunk {wildcards.chunk}"
    script:
        "../scripts/design_chunk.py"


checkpoint scores:
    input:
        target=every_pass(rules.target.output.target),
        reference=every_pass(rules.reference_run.output.index),
        registration=REGISTRATION_RUN,
        reused=REUSED,
        design=expand(every_pass(rules.design_chunk.output.index), chunk=CHUNKS),
    output:
        scores=f"{OUT}/scores.json",
    log:
        f"{OUT}/logs/scores.log",
    benchmark:
        f"{OUT}/benchmarks/scores.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("light"),
        runtime=minutes("light"),
    params:
        case=STAGES["scores"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "scores of the design"
    script:
        "../scripts/scores.py"

# The reference run and the initial design. Runs are kept in the run store, where every job looks first; the outputs
# below only list runs of the store, and a job that runs again finds its runs in the store.
# Measurement and target are inputs, so that a mistake in them is found before any run. They are not ancient(): if the
# job of an ancient() input runs, Snakemake does not check whether the following job must run, too, so that the old
# design would remain after a change of the seed, which also changes the target.

# Pass and part of the design of each chunk: all parts of pass 1 first, so that a pass added later changes no chunk of
# earlier passes.
PARTS = [(p, part) for p in PASSES for part in range(CASE.design_parts)]
CHUNKS = range(len(PARTS))
EARLIER = f"{OUT.parent}/{CASE.design.reuse}/runs" if CASE.design.reuse else None
# Without an earlier case the rule needs nothing, so that its job says at once that the case is not named.
FOR_REUSE = {
    "simulator": every_pass(SIMULATOR),
    "scene": rules.scene.output.scene,
    "geometry": every_pass(rules.geometry.output.geometry),
    "measurement": every_pass(rules.measurement.output.measurement),
}


# Runs copied from an earlier case. This rule comes before the reference run, which may be one of the copied runs.
rule reuse:
    input:
        **(FOR_REUSE if CASE.design.reuse else {}),
    output:
        **outputs("reuse"),
    log:
        f"{OUT}/logs/reuse.log",
    retries: 0
    resources:
        **resources("reuse"),
    params:
        case=STAGES["reuse"].params(CASE),
        runs=f"{OUT}/runs",
        earlier=EARLIER,
    message:
        words("reuse")
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
        **outputs("reference_run"),
    log:
        f"{OUT}/logs/passes/{{p}}/reference.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/reference.tsv"
    resources:
        **resources("reference_run", runs=2),
    params:
        case=of_pass("reference_run"),
        runs=f"{OUT}/runs",
    message:
        words("reference_run")
    script:
        "../scripts/reference.py"


def of_chunk(files):
    """Files of a rule in the pass of the chunk."""
    return lambda wildcards: every_pass(files, PARTS[int(wildcards.chunk)][0])


rule design_chunk:
    input:
        of_chunk(SIMULATOR),
        scene=rules.scene.output.scene,
        geometry=of_chunk(rules.geometry.output.geometry),
        target=of_chunk(rules.target.output.target),
        reused=REUSED,
    output:
        **outputs("design_chunk"),
    log:
        f"{OUT}/logs/design/{{chunk}}.log",
    benchmark:
        f"{OUT}/benchmarks/design_{{chunk}}.tsv"
    resources:
        **resources("design_chunk", runs=CASE.design.chunk),
    params:
        case=lambda wildcards: STAGES["design_chunk"].params(
            PASSES[PARTS[int(wildcards.chunk)][0]]
        ),
        part=lambda wildcards: PARTS[int(wildcards.chunk)],
        size=CASE.design_size,
        runs=f"{OUT}/runs",
    message:
        words("design_chunk")
    script:
        "../scripts/design_chunk.py"


checkpoint scores:
    input:
        target=every_pass(rules.target.output.target),
        reference=every_pass(rules.reference_run.output.index),
        registration=REGISTRATION_RUN,
        reused=REUSED,
        design=expand(rules.design_chunk.output.index, chunk=CHUNKS),
    output:
        **outputs("scores"),
    log:
        f"{OUT}/logs/scores.log",
    benchmark:
        f"{OUT}/benchmarks/scores.tsv"
    retries: 0
    resources:
        **resources("scores"),
    params:
        case=STAGES["scores"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        words("scores")
    script:
        "../scripts/scores.py"

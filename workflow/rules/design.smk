# The reference run and the initial design. Runs are kept in the run store, which every job asks
# first; the files below only index it, and a job that is done again for another reason finds them there.
# Measurement and target come first: a mistake in them ends before a run is spent. They are not ancient():
# behind an ancient() input whose own job runs, Snakemake does not ask a job for reasons of its own, so
# that a new seed, which changes the target too, would leave the old design in place.

CHUNKS = range(-(-CASE.design_size // CASE.design.chunk))
EARLIER = f"results/{CASE.design.reuse}/runs"


# An earlier case's runs; before the reference run, which may be among them.
rule reuse:
    input:
        SIMULATOR,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        measurement=rules.measurement.output.measurement,
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


rule reference_run:
    input:
        SIMULATOR,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        measurement=rules.measurement.output.measurement,
        reused=REUSED,
    output:
        index=f"{OUT}/reference.json",
    log:
        f"{OUT}/logs/reference.log",
    benchmark:
        f"{OUT}/benchmarks/reference.tsv"
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run", 2),
    params:
        case=STAGES["reference_run"].params(CASE),
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
        index=f"{OUT}/design/{{chunk}}.json",
    log:
        f"{OUT}/logs/design/{{chunk}}.log",
    benchmark:
        f"{OUT}/benchmarks/design_{{chunk}}.tsv"
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run", CASE.design.chunk),
    params:
        case=STAGES["design_chunk"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "design, chunk {wildcards.chunk}"
    script:
        "../scripts/design_chunk.py"


checkpoint scores:
    input:
        target=rules.target.output.target,
        reference=rules.reference_run.output.index,
        reused=REUSED,
        design=expand(rules.design_chunk.output.index, chunk=CHUNKS),
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

# The reference run and the initial design. Runs are kept in the run store, which every job asks
# first; the files below only index it. Measurement and target are ancient(): they must have been
# checked before a run is spent, but no change of them makes a finished run stale. ancient() marks the very
# object it is given: given rules.x.output.y it would make that output ancient for every rule.

# what determines a run's numbers, and which jobs must therefore run again when it changes
SIMULATION = CASE.sections("seed", "radar", "simulator", "materials")
CHUNKS = range(-(-CASE.design.size // CASE.design.chunk))


rule reference_run:
    input:
        SIMULATOR,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        measurement=ancient(f"{OUT}/measurement.h5"),
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
        case=SIMULATION,
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
        target=ancient(f"{OUT}/target.h5"),
        reference=ancient(f"{OUT}/reference.json"),
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
        case=SIMULATION | CASE.sections("design"),
        runs=f"{OUT}/runs",
    message:
        "design, chunk {wildcards.chunk}"
    script:
        "../scripts/design_chunk.py"


checkpoint scores:
    input:
        target=rules.target.output.target,
        reference=rules.reference_run.output.index,
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
        case=CASE.sections("seed", "materials"),
        runs=f"{OUT}/runs",
    message:
        "scores of the design"
    script:
        "../scripts/scores.py"

# The measured image and the target densities.


rule measurement:
    input:
        [FILES[key] for key in FILES if key.startswith("measurement.")],
        SIMULATOR if SYNTHETIC else [],
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
    output:
        measurement=update(f"{OUT}/measurement.h5"),
    log:
        f"{OUT}/logs/measurement.log",
    benchmark:
        f"{OUT}/benchmarks/measurement.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("measurement"),
        runtime=minutes("measurement", 1 if SYNTHETIC else 0),
    params:
        case=STAGES["measurement"].params(CASE),
    message:
        "measured image"
    script:
        "../scripts/measurement.py"


# The measured image is moved onto the image of the reference run, because the latter's materials and slopes lie where
# the scene has them.
rule registration:
    input:
        reference=f"{OUT}/reference.json",
        measurement=rules.measurement.output.measurement,
    output:
        registered=update(f"{OUT}/registered.h5"),
    log:
        f"{OUT}/logs/registration.log",
    benchmark:
        f"{OUT}/benchmarks/registration.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("registration"),
        runtime=minutes("registration"),
    params:
        case=STAGES["registration"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "registration"
    script:
        "../scripts/registration.py"


rule target:
    input:
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        reference=f"{OUT}/reference.json",
        registered=rules.registration.output.registered,
    output:
        target=update(f"{OUT}/target.h5"),
    log:
        f"{OUT}/logs/target.log",
    benchmark:
        f"{OUT}/benchmarks/target.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("target"),
        runtime=minutes("target"),
    params:
        case=STAGES["target"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "target densities"
    script:
        "../scripts/target.py"

# The measured image and the target densities.


rule measurement:
    input:
        inputs_of("measurement"),
        lambda wildcards: every_pass(
            SIMULATOR if synthetic(wildcards) else [], wildcards.at
        ),
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
    output:
        measurement=update(f"{OUT}/{{at}}measurement.h5"),
    log:
        f"{OUT}/logs/{{at}}measurement.log",
    benchmark:
        f"{OUT}/benchmarks/{{at}}measurement.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("measurement"),
        runtime=minutes("measurement", 1),
    params:
        case=of_pass("measurement"),
    message:
        "measured image"
    script:
        "../scripts/measurement.py"


# The measured image is moved onto the image of the reference run, in which materials and slopes lie where the scene has
# them.
rule registration:
    input:
        reference=f"{OUT}/{{at}}reference.json",
        measurement=rules.measurement.output.measurement,
    output:
        registered=update(f"{OUT}/{{at}}registered.h5"),
    log:
        f"{OUT}/logs/{{at}}registration.log",
    benchmark:
        f"{OUT}/benchmarks/{{at}}registration.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("registration"),
        runtime=minutes("registration"),
    params:
        case=of_pass("registration"),
        runs=f"{OUT}/runs",
    message:
        "registration"
    script:
        "../scripts/registration.py"


rule target:
    input:
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        reference=f"{OUT}/{{at}}reference.json",
        registered=rules.registration.output.registered,
    output:
        target=update(f"{OUT}/{{at}}target.h5"),
    log:
        f"{OUT}/logs/{{at}}target.log",
    benchmark:
        f"{OUT}/benchmarks/{{at}}target.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("target"),
        runtime=minutes("target"),
    params:
        case=of_pass("target"),
        runs=f"{OUT}/runs",
    message:
        "target densities"
    script:
        "../scripts/target.py"

# The measured image and the target densities.


rule measurement:
    input:
        measured_files,
        lambda wildcards: every_pass(
            SIMULATOR if synthetic(wildcards) else [], wildcards.p
        ),
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
    output:
        **outputs("measurement", measurement=update),
    log:
        f"{OUT}/logs/passes/{{p}}/measurement.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/measurement.tsv"
    retries: 0
    resources:
        **resources("measurement", runs=1),
    params:
        case=of_pass("measurement"),
    message:
        words("measurement")
    script:
        "../scripts/measurement.py"


# The measured image is moved onto a simulated image, in which materials and slopes lie where the scene has them. The
# first time, this is the image of the reference run. If a starting law differs much from the real law, other slopes are
# bright in the reference run than in the measured image, which misleads the registration. The image is therefore
# registered again, onto a run of the laws found with the first registration of the first pass. All passes have this run,
# so that it also trains the surrogate.
REGISTERED_TWICE = STAGES["registration_run"].is_needed(CASE)


rule registration:
    input:
        onto=(
            f"{OUT}/passes/{{p}}/registration_run.json"
            if REGISTERED_TWICE
            else f"{OUT}/passes/{{p}}/reference.json"
        ),
        first=[f"{OUT}/passes/{{p}}/first/registered.h5"] if REGISTERED_TWICE else [],
        measurement=rules.measurement.output.measurement,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
    output:
        **outputs("registration", registered=update),
    log:
        f"{OUT}/logs/passes/{{p}}/registration.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/registration.tsv"
    retries: 0
    resources:
        **resources("registration"),
    params:
        case=of_pass("registration"),
        runs=f"{OUT}/runs",
    message:
        words("registration")
    script:
        "../scripts/registration.py"


use rule registration as first_registration with:
    input:
        onto=f"{OUT}/passes/{{p}}/reference.json",
        first=[],
        measurement=rules.measurement.output.measurement,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
    output:
        **outputs("first_registration", registered=update),
    log:
        f"{OUT}/logs/passes/{{p}}/first_registration.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/first_registration.tsv"
    message:
        words("first_registration")


rule laws_of_image:
    input:
        scene=rules.scene.output.scene,
        # those of the first pass
        geometry=every_pass(rules.geometry.output.geometry)[0],
        reference=f"{OUT}/passes/1/reference.json",
        registered=every_pass(rules.first_registration.output.registered)[0],
    output:
        **outputs("laws_of_image"),
    log:
        f"{OUT}/logs/laws_of_image.log",
    retries: 0
    resources:
        **resources("laws_of_image"),
    params:
        case=STAGES["laws_of_image"].params(PASSES[1]),
        runs=f"{OUT}/runs",
    message:
        words("laws_of_image")
    script:
        "../scripts/laws_of_image.py"


rule registration_run:
    input:
        SIMULATOR,
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        laws=rules.laws_of_image.output.laws,
    output:
        **outputs("registration_run"),
    log:
        f"{OUT}/logs/passes/{{p}}/registration_run.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/registration_run.tsv"
    resources:
        **resources("registration_run", runs=1),
    params:
        case=of_pass("registration_run"),
        runs=f"{OUT}/runs",
    message:
        words("registration_run")
    script:
        "../scripts/registration_run.py"


rule target:
    input:
        scene=rules.scene.output.scene,
        geometry=rules.geometry.output.geometry,
        reference=f"{OUT}/passes/{{p}}/reference.json",
        registered=rules.registration.output.registered,
    output:
        **outputs("target", target=update),
    log:
        f"{OUT}/logs/passes/{{p}}/target.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/target.tsv"
    retries: 0
    resources:
        **resources("target"),
    params:
        case=of_pass("target"),
        runs=f"{OUT}/runs",
    message:
        words("target")
    script:
        "../scripts/target.py"

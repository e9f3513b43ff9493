# Scene and geometry, which do not depend on the laws' parameters.

from radcal.radar import simulator_version
from radcal.sections.scene import SCENES

# The heading of the track turns the scene's grid. For a track to the north, this parameter of the rule is left out, so
# that jobs of earlier cases do not run again.
HEADING = {"heading_deg": CASE.radar.heading_deg} if CASE.radar.heading_deg else {}


rule scene:
    input:
        [FILES[key] for key in FILES if key.startswith("scene.")],
    output:
        **outputs("scene", scene=update),
    log:
        f"{OUT}/logs/scene.log",
    benchmark:
        f"{OUT}/benchmarks/scene.tsv"
    retries: 0
    resources:
        **resources("scene"),
    params:
        **HEADING,
        **SCENES.origin(CASE.scene.source),  # of another distribution: its version
        case=STAGES["scene"].params(CASE),
    message:
        words("scene")
    script:
        "../scripts/scene.py"


# The geometry is part of radcal's own simulator and depends on its version. For another simulator it does not change
# with the version, because the records of finished runs hold pixels of this geometry.
VERSION = (
    {"version": max(simulator_version(one.radar.earth) for one in CASE.passes)}
    if CASE.simulator.own
    else {}
)


# A case of one strip has no jobs of strips.
STRIPS = CASE.simulator.strips


rule frame:
    input:
        scene=rules.scene.output.scene,
    output:
        **outputs("frame", frame=temp),
    log:
        f"{OUT}/logs/passes/{{p}}/frame.log",
    retries: 0
    resources:
        **resources("frame"),
    params:
        case=of_pass("frame"),
    message:
        words("frame")
    script:
        "../scripts/frame.py"


rule strip:
    input:
        scene=rules.scene.output.scene,
        frame=rules.frame.output.frame,
    output:
        **outputs("strip", strip=temp),
    log:
        f"{OUT}/logs/passes/{{p}}/strips/{{s}}.log",
    retries: 0
    resources:
        **resources("strip", parts=STRIPS),
    params:
        **VERSION,
        case=of_pass("strip"),
        strips=STRIPS,
    message:
        words("strip")
    script:
        "../scripts/strip.py"


rule geometry:
    input:
        scene=rules.scene.output.scene,
        strips=(
            expand(rules.strip.output.strip, s=range(STRIPS), allow_missing=True)
            if STRIPS > 1
            else []
        ),
    output:
        **outputs("geometry", geometry=update),
    log:
        f"{OUT}/logs/passes/{{p}}/geometry.log",
    benchmark:
        f"{OUT}/benchmarks/passes/{{p}}/geometry.tsv"
    retries: 0
    resources:
        **resources("geometry"),
    params:
        **VERSION,
        case=of_pass("geometry"),
        immaterial=sorted(CASE.simulator.not_told),
    message:
        words("geometry")
    script:
        "../scripts/geometry.py"

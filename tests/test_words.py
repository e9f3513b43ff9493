"""Sentences of findings."""

from archives import RADIOMETRY

from radcal.findings import Finding
from radcal.words import asked_steps, beside_headline, headline, remarks, sentence, state, widths

DETERMINED = Finding(
    "determined",
    "note",
    "dyke",
    {"half_width_db": 0.84, "from_deg": 14.75, "to_deg": 40.2, "field_half_width_db": 0.62, "systematic_db": 0.53},
)
NOT_REFUTED = Finding("not_refuted", "note", "dyke", {"rms_db": 0.1, "p05_db": 0.0, "p95_db": 0.4, "noticed_db": 1.24})
LEVEL = Finding("level", "note", "pass 1", {"level_db": 0.1, "p05_db": -0.2, "p95_db": 0.4})
WATER = Finding(
    "fixed_law", "warning", "water", {"error_db": 2.0, "p05_db": 1.4, "p95_db": 2.7}, "materials.water.parameters"
)


def test_a_title_says_where_sigma0_is_determined():
    assert state("dyke", [LEVEL, DETERMINED]) == "determined to +-0.8 dB between 15 and 40 degrees"
    withheld = Finding("withheld", "refusal", "dyke", {"half_width_db": 0.8})
    assert state("dyke", [withheld]) == "determined at no angle, because an image is refused"
    assert state("stem beans", [DETERMINED]) == ""


def test_widths_are_those_of_material_fields_and_systematic_part():
    assert widths("dyke", [DETERMINED]).startswith(
        "+-0.8 dB for the material, +-0.6 dB for its fields in this image, and"
    )
    assert "+-0.5 dB for the material by errors of level" in widths("dyke", [DETERMINED])
    assert widths("dyke", [NOT_REFUTED]) == ""


def test_remarks_are_what_no_verdict_tells_and_warnings_come_first():
    assert remarks([DETERMINED, LEVEL, NOT_REFUTED, WATER]) == [WATER, LEVEL]


def test_what_the_headline_tells_is_not_told_again():
    said = [sentence(one) for one in (WATER, RADIOMETRY)]
    assert beside_headline(said, [LEVEL, WATER]) == [said[1]]
    # a refusal stands there in place of the warning
    assert beside_headline(said, [LEVEL, WATER, RADIOMETRY]) == [said[0]]
    assert beside_headline(said, [LEVEL]) == said


def test_a_step_that_stands_beside_the_headline_is_not_said_in_it():
    findings = [WATER, DETERMINED, NOT_REFUTED]
    (step,) = asked_steps(findings)
    assert step.text in headline(["dyke"], findings, True)
    beside = headline(["dyke"], findings, True, [step])
    assert step.text not in beside
    assert headline(["dyke"], findings, True).startswith(beside.removesuffix("."))

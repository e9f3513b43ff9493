"""The page says what it must, loads nothing and is the same every time."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from archives import changed_findings, changed_material, configured, ended, image, posterior
from assessment_samples import held_cells

from radcal.figures.figures import Figure
from radcal.findings import Finding
from radcal.page.html import _material, _number, _span, write_report
from radcal.posterior.radiometry import Radiometry
from radcal.results.summary import summarise

VOID = {"meta", "link", "img", "br"}


class Page(HTMLParser):
    """Tags, addresses and the visible text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.images: list[dict[str, str]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        found = dict(attrs)
        self.addresses += [value for key, value in found.items() if key in ("src", "href", "srcset", "data", "action")]
        if tag == "img":
            self.images.append(found)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "title"} & set(self.open):
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", "".join(self.words))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Stand-ins: the page embeds bytes, whatever they show."""
    folder = tmp_path_factory.mktemp("figures")
    figures = []
    for name, material in (("images", None), ("cost_dyke", "dyke"), ("cost_stem_beans", "stem beans")):
        png = folder / f"{name}.png"
        png.write_bytes(b"\x89PNG " + name.encode())
        figures.append(
            Figure(name, "Title", "A <caption> & more", 'an "alt" text', png, folder / f"{name}.pdf", material)
        )
    return figures


def render(path, archive, figures=()):
    write_report(path, archive, figures)
    text = path.read_text(encoding="utf-8")
    return text, Page(text)


@pytest.fixture(scope="module")
def page(made, pictures, tmp_path_factory):
    return render(tmp_path_factory.mktemp("page") / "report.html", made.archive, pictures)


def test_verdict_comes_first_and_claims_no_more_than_the_density(page):
    text = page[1].text
    assert "Stopped after 6 runs: the tolerance of 1.0" in text
    order = [
        "Of 2 materials 2 are determined at some angles",
        "Stopped after",
        "What has been shown",
        "What has not been shown: that the law is right",
        "Sigma0",
        "Densities",
        "Pictures",
    ]
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    assert "different laws can give the same histogram" in text
    assert re.search(
        r"for dyke: the law of the search differs from it by up to [\d.]+ dB over the incidence seen", text
    )
    assert "the law nearest to the median (parameters_model) by up to" in text
    assert "For stem beans whether the law is right beyond that cannot be checked from this image alone" in text


def settled(archive):
    """As after a calibration in classes."""
    return ended(configured(archive, objective="classes"), "settled", **dict.fromkeys(archive.materials, "settled"))


def determined(name, **numbers):
    """Finding that sigma0 of a material is determined."""
    known = {"half_width_db": 1.5, "from_deg": 22.25, "to_deg": 39.5, "field_half_width_db": 0.9, "systematic_db": 0.4}
    return Finding("determined", "note", name, {**known, **numbers})


RADIOMETRY = Finding(
    "radiometry",
    "refusal",
    "pass 1",
    {"exponent": 0.93, "error": 0.1, "declared": "sigma0_local", "other": "sigma0_ref"},
    "radar.radiometry: sigma0_ref",
)


def test_the_bar_is_good_only_if_something_is_determined_and_nothing_refused_or_refuted(made, tmp_path):
    def good(archive):
        return '<p class="verdict good">' in render(tmp_path / "report.html", archive)[0]

    archive = settled(made.archive)
    assert good(archive)
    refuted = posterior(form=replace(posterior().form, refuted=True))
    assert not good(changed_material(archive, "dyke", posterior=refuted))
    # undetermined, of one material and of all
    lost = posterior(known_between_deg=None, known_half_width_db=None)
    archive = changed_material(archive, "dyke", posterior=lost)
    assert good(archive)
    assert not good(changed_material(archive, "stem beans", posterior=lost))
    assert not good(changed_findings(archive, RADIOMETRY))
    assert not good(ended(archive, "max_runs", dyke="max_runs"))


def test_findings_are_listed_warnings_first_and_notes_folded(made, tmp_path):
    note = Finding("level", "note", "pass 1", {"level_db": 0.1, "p05_db": -0.2, "p95_db": 0.4})
    numbers = {"beyond_db": 2.25, "cause": "cause unknown"}
    outside = Finding("law_outside_band", "warning", "dyke", numbers)
    findings = (note, determined("dyke"), determined("stem beans"), outside, RADIOMETRY)
    archive = replace(
        changed_findings(made.archive, *findings), notes=(Finding("heading_missing", "warning", "radar.heading_deg"),)
    )
    text, parsed = render(tmp_path / "report.html", archive)
    order = [
        "pass 1: by the fixed materials the image is sigma0_ref",
        "dyke: sigma0 is determined to +-1.5 dB",
        "Next: set radar.radiometry: sigma0_ref.",
        "warning: radar.heading_deg is not given",
        "leaves the band by up to 2.2 dB (cause unknown)",
        "Further findings",
        "by a level of +0.10 dB",
    ]
    places = [parsed.text.index(words) for words in order]
    assert places == sorted(places)
    # the refusal stands in the first line, and the note in the folded part alone
    assert parsed.text.count(order[0]) == parsed.text.count(order[6]) == 1
    assert "by a level of" in re.search(r"<details><summary>Further findings.*?</details>", text, re.DOTALL)[0]


def test_bands_and_form_errors_have_a_table(made, tmp_path):
    archive = changed_findings(made.archive, determined("dyke"))
    level = posterior(known_between_deg=None, known_half_width_db=None, form=None)
    archive = changed_material(archive, "stem beans", posterior=level, level_only=True)
    text = render(tmp_path / "report.html", archive)[1].text
    cells = ["dyke", "22.25 to 39.5", "1.50", "0.90", "0.40", r"0.25 \(0.06 to 0.70\)", "1.40", "not refuted", "0.30"]
    assert re.search(r"\s*".join([*cells, "0.15", "7, 210"]), text), text
    assert re.search(r"\s*".join(["stem beans", "level only", *"––––––", "0.30", "0.15", "7, 210"]), text)
    for change, words in (({"noticed": True}, "noticed"), ({"refuted": True}, "refuted")):
        form = replace(posterior().form, **change)
        other = changed_material(archive, "dyke", posterior=posterior(form=form))
        assert re.search(rf"1\.40\s*{words}\s*0\.30", render(tmp_path / "report.html", other)[1].text)


def test_fixed_laws_level_and_radiometry_have_tables(made, tmp_path):
    text = render(tmp_path / "report.html", made.archive)[1].text
    assert re.search(r"unused\s*0\.07 \(−0\.52 to 0\.61\)", text)
    assert re.search(r"1\s*0\.12 \(−0\.31 to 0\.43\)\s*0\.14\s*0\.08\s*unused", text)
    nothing = image(radiometry={"1": Radiometry(float("nan"), float("inf"), 1, 0.0, ())})
    text = render(tmp_path / "report.html", replace(made.archive, image=nothing))[1].text
    assert re.search(r"0\.43\)\s*–\s*–\s*no material \(unchecked\)", text)
    without = render(tmp_path / "report.html", replace(made.archive, image=image(laws_db={})))[1].text
    assert "Fixed law" not in without


def test_page_is_well_formed_and_loads_nothing(page):
    text, parsed = page
    assert parsed.open == []
    assert "script" not in parsed.tags
    assert all(address.startswith("data:") for address in parsed.addresses)
    assert not re.search(r"https?://|@import|url\(", text)


def test_every_picture_is_embedded(page, pictures):
    images = page[1].images
    assert [base64.b64decode(image["src"].partition(",")[2]) for image in images] == [
        figure.png.read_bytes() for figure in pictures
    ]
    assert all(image["alt"] == 'an "alt" text' for image in images)
    assert "A <caption> & more" in page[1].text


def test_foreign_text_is_escaped(page):
    text, parsed = page
    assert "<b>seed</b>" not in text
    assert "synthetic <b>seed</b> 2 & more" in parsed.text


def test_a_table_too_wide_for_the_page_scrolls_in_its_own_box(page):
    text, _ = page
    assert text.count("<table") > 5
    assert len(re.findall(r'<div class="scroll">\s*<table', text)) == text.count("<table")


def test_tables(page):
    text = page[1].text
    assert "X1 is at its upper bound (50 dB)" not in text
    runs = text[text.index("Runs of the simulator") :]
    assert re.findall(r"(reference|design|infill|final|total)\s*(\d+)", runs)[:5] == [
        ("reference", "1"), ("design", "4"), ("infill", "2"), ("final", "1"), ("total", "8"),
    ]  # fmt: skip
    assert "50.00 (at bound)" in text
    assert "More skewed than a skew normal can be" in text  # at_boundary of the stem beans
    for words in ("skewness", "standard deviation [dB]", "Kolmogorov", "Hellinger", "eligible", "mangia"):
        assert words in text
    assert "sampler: sobol" in text  # the configuration
    assert "numpy" in text


def test_the_table_of_parameters_has_their_intervals(page, made, tmp_path):
    without = changed_material(changed_material(made.archive, "dyke", posterior=None), "stem beans", posterior=None)
    assert "5 to 95 %</th>" not in render(tmp_path / "report.html", without)[0].replace("incidence, 5 to 95 %", "")
    text = page[0]
    assert "<th>search</th><th>5 to 95 %</th><th>nearest to<br>the median</th><th>start</th>" in text
    x = summarise(made.archive)["materials"]["dyke"]["parameters"]["X4"]
    assert f"{x:.4g}</td><td>4.00 to 5.90</td><td>4.800</td><td>" in text


@pytest.mark.parametrize("hidden", [True, False])
def test_one_material(made, tmp_path, hidden):
    dyke = made.archive.materials["dyke"]
    dyke = dyke if hidden else replace(dyke, hidden=None)
    archive = ended(replace(made.archive, materials={"dyke": dyke}), "rms")
    text = render(tmp_path / "report.html", archive)[1].text
    assert "Converged after 6 runs: the tolerance of" in text
    assert "The density of dyke's backscatter is matched to rms" in text
    assert ("cannot be checked from this image alone" in text) is not hidden
    assert ("The truth behind this synthetic measurement is known" in text) is hidden
    assert "unknown" not in text.replace("(cause unknown)", "")
    # what is not matched, is not called matched
    text = render(tmp_path / "report.html", ended(archive, "max_runs", dyke="max_runs"))[1].text
    assert "The density of dyke's backscatter differs from the measured one by an rms of" in text


def test_the_truth_is_compared_over_the_incidence_of_all_passes(made, tmp_path):
    """The dyke is seen from 20 to 40 degrees and from 46 to 66 degrees, where its law is further from the truth."""
    seen = [np.linspace(low, low + 20.0, 201, dtype=np.float32) for low in (20.0, 46.0)]
    dyke, first, config = made.archive.materials["dyke"], made.archive.passes["1"], json.loads(made.archive.config)
    targets = {str(k): replace(dyke.target, incidence_deg=angles) for k, angles in enumerate(seen, start=1)}
    known = first.registered.measurement
    other = replace(known, hidden={"dyke": (known.hidden["dyke"][0] - 50.0, *known.hidden["dyke"][1:])})
    archive = replace(
        configured(
            changed_material(made.archive, "dyke", targets=targets),
            **{key: [config[key]] * 2 for key in ("radar", "measurement")},
        ),
        passes={
            "1": first,
            "2": replace(first, rms={"dyke": 0.1}, registered=replace(first.registered, measurement=other)),
        },
    )
    near, far = (one["materials"]["dyke"]["difference_db"] for one in summarise(archive)["passes"])
    assert far > 1.1 * near
    text = render(tmp_path / "report.html", archive)[1].text
    assert re.search(r"47\.0 to 65\.0\s*1\.9\s*0\.100", text)
    assert f"up to {_number(far, 2)} dB over the incidence seen (21.0 to 39.0 and 47.0 to 65.0 deg), the law" in text
    assert re.search(r"\(parameters_model\) by up to [\d.]+ dB in the first pass\.", text)


def test_numbers_that_are_unknown_are_left_out(made, tmp_path):
    assert (_span([2.0, None, 1.5]), _span([None])) == ("1.5 to 2.0", "\N{EN DASH}")
    rms = np.full(made.archive.runs.kind.size, np.nan)
    text = render(tmp_path / "report.html", changed_material(made.archive, "dyke", rms=rms))[1].text
    assert "The worst, stem beans, is at rms" in text


def test_same_bytes_every_time(made, pictures, page, tmp_path):
    assert render(tmp_path / "elsewhere" / "again.html", made.archive, pictures)[0] == page[0]
    assert [p.name for p in (tmp_path / "elsewhere").iterdir()] == ["again.html"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "\N{EN DASH}"),
        (float("nan"), "\N{EN DASH}"),
        (0.0, "0"),
        (12.3456, "12.3"),
        (-0.4557, "-0.456"),
        (123456.7, "123,457"),
        (9.68e-7, "9.68 x 10⁻⁷"),
        (-2.5e12, "-2.50 x 10¹²"),
    ],
)
def test_numbers(value, text):
    plain = {"\N{NARROW NO-BREAK SPACE}": " ", "\N{MULTIPLICATION SIGN}": "x", "\N{MINUS SIGN}": "-"}
    assert _number(value).translate(str.maketrans(plain)) == text


def test_a_better_law_outside_of_a_bound_is_suspected_only_where_the_form_is_wrong(made, tmp_path):
    """Or, where the form cannot be tested, after a failed search."""
    result, material = made.archive.materials["stem beans"], made.archive.configured.materials["stem beans"]
    found = summarise(made.archive)["materials"]["stem beans"]
    assert found["stop_reason"] == "unreachable"
    for form, reason, flagged in (
        ({"noticed": True}, "rms", ["X1"]),
        ({"noticed": False}, "unreachable", []),
        (None, "unreachable", ["X1"]),
        (None, "rms", []),
    ):
        data = _material("stem beans", {**found, "misfit": form, "stop_reason": reason}, result, material, ())
        assert [p["name"] for p in data["at_bounds"]] == flagged
        assert data["parameters"][0]["value"] == 50.0
    near = {**found, "parameters": {**found["parameters"], "X1": 50.0 - 1e-9}}
    assert _material("stem beans", near, result, material, ())["parameters"][0]["value"] == 50.0
    wrong = changed_material(made.archive, "dyke", posterior=posterior(form=replace(posterior().form, noticed=True)))
    text = render(tmp_path / "report.html", wrong)[1].text
    assert "dyke: X1 is at its upper bound (50 dB); a better law may lie outside the bounds." in text


def test_errors_on_held_out_ground_are_in_a_table(made, tmp_path):
    path = tmp_path / "report.html"
    render(path, made.archive)
    assert "Ground that is held out" not in path.read_text()
    cells = held_cells()
    few = held_cells(slice(1, None))
    render(path, changed_material(made.archive, "dyke", posterior=posterior(held=cells, left_out=few)))
    page = path.read_text()
    assert "dyke</th><td>2, 3</td><td>1.75, 67 %</td><td>2.07, 33 %</td><td>2.59, 100 %</td>" in page
    assert "dyke (whole fields)</th><td>1, 2</td>" in page
    render(path, changed_material(made.archive, "dyke", posterior=posterior(held=cells)))
    assert "whole fields" not in path.read_text()

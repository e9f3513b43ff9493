"""The page says what it must, loads nothing and is the same every time."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from archives import changed_check, changed_material, held_out_blocks, left_out_fields, posterior

from radcal.report.archive import PassLaw, PassSummary
from radcal.report.figures import Figure
from radcal.report.html import _material, _number, _span, write_report
from radcal.report.law_notes import MANY_X, at_bound
from radcal.report.summary import summarise

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
    assert "Stopped after 6 runs with stem beans outside the tolerance of 1.0" in text
    order = [
        "Stopped after",
        "What has been shown",
        "What has not been shown: that the law is right",
        "Results",
        "Pictures",
    ]
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    assert "A matched density does not determine the law" in text
    assert re.search(r"known for dyke: the law found differs from it by up to [\d.]+ dB over the incidence seen", text)
    assert "For stem beans whether the law found is right cannot be checked from this image alone" in text


def checked(archive):
    """As after a calibration in classes with held-out ground."""
    archive = replace(archive, objective="classes", converged=True, reason="settled")
    classes = {"class_deg": [20.0, 40.0], "class_db": [1.0, -3.0], "class_error_db": [0.2, 0.2]}
    for name, constant in (("dyke", 3.0), ("stem beans", 0.8)):
        archive = changed_material(archive, name, reason="settled")
        archive = changed_check(
            archive,
            name,
            held=held_out_blocks(rmse_constant_db=constant, patch_gain=0.25 * constant),
            left_out=left_out_fields(4 if name == "dyke" else 0),
            recommended="average" if name == "dyke" else "constant",
            law_weight=0.75 if name == "dyke" else 0.0,
            recommended_why="its reason",
            identified=name == "dyke",
            looks=2.5,
            sentences=(f"{name}: remarkable.",),
            **{key: np.array(values) for key, values in classes.items()},
        )
    return archive


def test_the_first_line_is_the_verdict_and_the_next_how_the_search_ended(page, made, tmp_path):
    first = re.search(r"Measurement: .*?\. (.*?) What has been shown", page[1].text)[1]
    assert first.startswith(
        "Of 2 materials 2 cannot be tested (dyke, stem beans); sigma0 is known at some angles for none."
    )
    assert "What was compared is the histogram, which does not determine a law" in first
    archive = changed_check(checked(made.archive), "stem beans", identified=True)
    text = render(tmp_path / "report.html", archive)[1].text
    assert (
        "Converged: the stop criterion is met for the laws of 2 materials after 6 runs. The recommended predictor of "
        "other fields for stem beans is a constant, not the law."
    ) in text
    archive = changed_check(archive, "stem beans", identified=False)
    text = render(tmp_path / "report.html", archive)[1].text
    assert (
        "materials after 6 runs. Sigma0 of stem beans is called known at no angle. The recommended predictor of "
        "other fields for stem beans is a constant, not the law."
    ) in text
    # of these, the verdict says it
    fitted = archive.materials["stem beans"].fitted
    for change in ({"fits": False}, {"level_only": True}):
        other = changed_material(archive, "stem beans", fitted=replace(fitted, **change))
        assert "Sigma0 of stem beans" not in render(tmp_path / "report.html", other)[1].text
    archive = changed_material(replace(archive, converged=False, reason="max_runs"), "dyke", reason="max_runs")
    text = render(tmp_path / "report.html", archive)[1].text
    assert "Stopped after 6 runs before the stop criterion was met for the law of dyke: maximum number of runs." in text


def test_held_out_ground_has_a_table(page, made, tmp_path):
    assert "Held-out ground" not in page[1].text
    text = render(tmp_path / "report.html", checked(made.archive))[1].text
    cells = [
        "dyke",
        "6",
        "3.00",
        "2.50",
        "1.25",
        "1.00",
        "4.00",
        "0.75",
        "88 %",
        r"2.5 \([\d.]+\)",
        r"[\d.]+|–",
        "better than a constant",
    ]
    assert re.search(r"\s*".join(f"(?:{cell})" for cell in cells), text), text
    # like against like, beyond the standard error: 0.2 is less than 0.25
    assert "not shown to be better than a constant, sigma0 known at no angle" in text
    assert "blocks that no law has seen" in text
    # with keep both or fields, laws are fitted anew: no block is unseen by the law found
    config = json.dumps({**json.loads(made.archive.config), "validation": {"keep": "fields"}})
    anew = render(tmp_path / "anew.html", replace(checked(made.archive), config=config))[1].text
    assert "each fitted anew without these blocks, which the law found has seen" in anew
    assert "no law has seen" not in anew
    assert "seen elsewhere" not in text
    assert re.search(
        r"Whole fields left out.*dyke\s*4\s*2\.25\s*1\.75\s*law weighted 0\.75, constant 0\.25: its reason", text
    )
    assert re.search(r"stem beans\s*0\s*–\s*–\s*constant: its reason", text)
    # of the density: a start without a curve predicts none
    assert re.search(r"dyke\s*0\.03\s*0\.20\s*–\s*0\.25\s*−1\.50\s*–", text)
    assert "stem beans: remarkable." in text


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


def test_material_names_are_escaped(made, tmp_path):
    name = "grass & <i>beans<i>"
    materials = made.archive.materials
    renamed = {"dyke": materials["dyke"], name: materials["stem beans"]}
    text, parsed = render(tmp_path / "report.html", replace(made.archive, materials=renamed))
    assert name in parsed.text
    assert "<i>" not in text
    assert "dyke" in parsed.text


def test_a_table_too_wide_for_the_page_scrolls_in_its_own_box(page):
    text, _ = page
    assert text.count("<table") > 5
    assert len(re.findall(r'<div class="scroll">\s*<table', text)) == text.count("<table")


def test_tables(page):
    text = page[1].text
    assert "X1 is at its upper bound (50 dB)" in text
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
    assert "<th>5 to 95 %</th>" not in page[0]
    text, _ = render(tmp_path / "report.html", changed_material(made.archive, "dyke", posterior=posterior()))
    assert "<th>found</th><th>5 to 95 %</th><th>start</th>" in text
    x = summarise(made.archive)["materials"]["dyke"]["parameters"]["X4"]
    assert f"{x:.4g}</td><td>4.00 to 5.90</td><td>" in text


def test_the_registration_run_has_a_line_of_its_own(made, tmp_path):
    runs = made.archive.runs
    kinds = runs.kind.astype("<U12")
    kinds[1] = "registration"
    text = render(tmp_path / "report.html", replace(made.archive, runs=replace(runs, kind=kinds)))[1].text
    told = re.findall(r"(reference|registration|design|total)\s*(\d+)", text[text.index("Runs of the simulator") :])
    assert told[:4] == [("reference", "1"), ("registration", "1"), ("design", "3"), ("total", "8")]


@pytest.mark.slow
def test_what_does_not_apply_is_not_said(made, tmp_path):
    """Of a material seen at one incidence no slope is doubted; equal densities alone have equal fresh numbers."""
    bins = changed_check(replace(made.archive, objective="classes"), "dyke")
    text = render(tmp_path / "report.html", bins)[1].text
    assert "Held-out ground can show it only if it has other fields or angles (validation.keep: fields)." in text
    assert "the law found is right cannot be checked from this image" in text
    # dyke's densities agree, those of stem beans do not
    assert "so fresh numbers of dyke should come out near that." in text
    assert "Where rms is far above" in text
    assert "A law of another form" not in text
    for names, words in (
        (["dyke"], "up to 1.4 dB at an"),
        (["stem beans"], "1.4 to 2.3 dB at an incidence seen (dyke"),
    ):
        for name in names:
            missed = {"dyke": 1.44, "stem beans": 2.31}[name]
            fitted = replace(bins.materials[name].fitted, fits=True, missed_db=missed)
            bins = changed_material(bins, name, fitted=fitted)
        assert words in render(tmp_path / "report.html", bins)[1].text
    for name in bins.materials:
        fitted = replace(bins.materials[name].fitted, fits=None, level_only=True)
        bins = changed_material(bins, name, fitted=fitted, rms=np.full(made.archive.runs.kind.size, 1.0))
    text = render(tmp_path / "report.html", bins)[1].text
    assert "A law of another form" not in text
    assert "Held-out ground" not in text
    assert "dyke and stem beans are seen at one incidence: the image can show their level there, but no law" in text
    assert "should come out near that" not in text
    assert "cannot be checked from this image" not in text


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"converged": True, "reason": "rms"}, "Converged: the backscatter densities of all 2 materials agree with"),
        ({"converged": False, "reason": "running"}, "Not finished: after 6 runs the backscatter densities of all 2"),
        ({"converged": False, "reason": "max_runs"}, "Stopped after 6 runs with stem beans outside the tolerance"),
    ],
)
def test_verdicts(made, tmp_path, attributes, words):
    assert words in render(tmp_path / "report.html", replace(made.archive, **attributes))[1].text


@pytest.mark.parametrize("hidden", [True, False])
def test_one_material(made, tmp_path, hidden):
    dyke = made.archive.materials["dyke"]
    dyke = dyke if hidden else replace(dyke, hidden=None)
    archive = replace(made.archive, materials={"dyke": dyke}, converged=True, reason="rms")
    text = render(tmp_path / "report.html", archive)[1].text
    assert "Converged: the backscatter density of dyke agrees with the measured within the tolerance" in text
    assert "The density of dyke's backscatter is matched to rms" in text
    assert ("cannot be checked from this image alone" in text) is not hidden
    assert ("The truth behind this synthetic measurement is known" in text) is hidden
    assert "unknown" not in text
    # what the test of the fit has shown, is not called open; what is not matched, is not called matched
    one = changed_material(archive, "dyke", fitted=replace(dyke.fitted, fits=False), reason="max_runs")
    text = render(tmp_path / "report.html", one)[1].text
    assert "cannot be checked from this image alone" not in text
    assert "The density of dyke's backscatter differs from the measured one by an rms of" in text


@pytest.mark.slow
def test_a_better_law_is_excluded_as_far_as_the_surrogate_does(made, tmp_path):
    """Laws that meet the stop criterion; where the search ended before, better laws may exist."""
    promise = "predicts no law that is clearly better and differs by more than stop.law_db."

    def shown(archive):
        return re.search(r"What has been shown (.*?) The search compared", render(tmp_path / "p", archive)[1].text)[1]

    archive = checked(made.archive)
    assert shown(archive) == f"2 of 2 laws meet the stop criterion: the surrogate of all runs {promise}"
    archive = changed_material(archive, "dyke", reason="max_runs")
    assert shown(archive) == (
        f"1 of 2 laws meets the stop criterion: the surrogate of all runs {promise} Better laws of the other materials "
        "may exist."
    )
    nobody = changed_material(archive, "stem beans", reason="stagnation")
    assert shown(nobody) == "None of 2 laws meets the stop criterion. Better laws may exist."
    alone = replace(archive, materials={"dyke": archive.materials["dyke"]})
    assert shown(alone) == "The law of dyke does not meet the stop criterion. Better laws may exist."
    met = shown(changed_material(alone, "dyke", reason="settled"))
    assert met == f"The law of dyke meets the stop criterion: the surrogate of all runs {promise}"


def test_the_truth_is_compared_over_the_incidence_of_all_passes(made, tmp_path):
    def law(low, high, difference):
        return PassLaw(low, high, rms=0.1, sd_first_db=1.0, sd_all_db=0.5, pixels=90, difference_db=difference)

    one = {"looks": 4.0, "measurement": "m", "registration": "r.", "levels": "l.", "notes": (), "final_runs": 1}
    one |= {"depression_deg": 40.0, "look_side": "right", "polarisation": "HH", "keys": made.archive.runs.key}
    found = {"1": law(21.0, 41.0, 1.25), "2": law(47.0, 66.0, 87.0)}
    passes = {key: PassSummary(**one, materials={"dyke": value}) for key, value in found.items()}
    text = render(tmp_path / "report.html", replace(made.archive, passes=passes))[1].text
    assert "up to 87 dB over the incidence seen (21.0 to 41.0 and 47.0 to 66.0 deg)." in text


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


def test_bounds():
    assert [at_bound(x, 0.0, 50.0) for x in (0.0, 0.04, 0.06, 25.0, 49.97)] == ["lower", "lower", "", "", "upper"]


def test_a_bound_on_which_sigma0_hardly_depends_is_not_said_to_hide_a_better_law(made):
    """One sentence on each X at a bound: that many X give nearly the law, or that a better law may lie outside."""
    result = made.archive.materials["stem beans"]
    found = summarise(made.archive)["materials"]["stem beans"]
    names = list(found["parameters"])
    value = found["parameters"]["X1"]
    ends = {"parameters_p05": dict.fromkeys(names, -99.0), "parameters_p95": dict.fromkeys(names, 99.0)}
    outside = {**ends, "parameters_p95": {**ends["parameters_p95"], "X1": value - 3.0}}
    for interval, remark, flagged in (
        (ends, MANY_X, ["X1"]),
        (outside, "sigma0 of the best run lies outside of its own 90 % band.", ["X1"]),
        (outside, None, ["X1"]),
        (outside, f"X1 is at its upper bound 50: {MANY_X}", []),
    ):
        data = _material("stem beans", {**found, **interval, "parameters_remark": remark}, result, ())
        assert [p["name"] for p in data["at_bounds"]] == flagged
        assert data["parameters"][0]["value"] == 50.0
    near = {**found, "parameters": {**found["parameters"], "X1": 50.0 - 1e-9}}
    assert _material("stem beans", near, result, ())["parameters"][0]["value"] == 50.0

"""The page says what it must, loads nothing and is the same every time."""

import base64
import gzip
import hashlib
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from archives import RADIOMETRY, changed_findings, changed_material, configured, determined, ended, image, posterior
from assessment_samples import held_cells
from lxml import html
from PIL import Image

from radcal.figures.figures import Figure
from radcal.findings import Finding
from radcal.page.html import _embedded, _number, _span, provenance_of, write_report
from radcal.posterior.radiometry import Radiometry
from radcal.results.summary import summarise

VOID = {"meta", "link", "img", "br", "input"}


COLOURS = ("#204080", "#a03010", "#308050")


class Page(HTMLParser):
    """Open tags and the visible text of a page."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.words = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "title", "script"} & set(self.open):
            self.words.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", "".join(self.words))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Stand-ins: the page embeds pictures, whatever they show."""
    folder = tmp_path_factory.mktemp("figures")
    figures = []
    for k, (name, material) in enumerate(
        (("residual", None), ("law_dyke", "dyke"), ("densities_stem_beans", "stem beans"))
    ):
        png = folder / f"{name}.png"
        Image.new("RGB", (3 + k, 2), COLOURS[k]).save(png)
        figures.append(
            Figure(name, "Title", "A <caption> & more", 'an "alt" text', png, folder / f"{name}.pdf", material)
        )
    return figures


def render(path, archive, figures=()):
    write_report(path, archive, figures)
    text = path.read_text(encoding="utf-8")
    assert "=&#34;" not in text  # an attribute whose quotes were escaped
    return text, Page(text)


@pytest.fixture(scope="module", autouse=True)
def _small_library():
    """A stand-in for plotly.js, which takes long to compress."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("radcal.page.html.embedded_library", lambda: "library")
        yield


@pytest.fixture(scope="module")
def page(made, pictures, tmp_path_factory):
    return render(tmp_path_factory.mktemp("page") / "report.html", made.archive, pictures)


def test_the_table_of_runs_has_every_run_and_the_chosen_one_is_marked(page, made):
    runs, material = made.archive.runs, made.archive.materials["dyke"]
    first = page[0].index("<summary>All runs</summary>")
    rows = re.findall(
        r"<tr( class=\"chosen\")?><th scope=\"row\">(\d+)</th>(.*?)</tr>", page[0][first:].split("</table>")[0]
    )
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", each) for _, _, each in rows]
    assert [each[0] for each in cells] == runs.kind.tolist()
    assert [int(number) for chosen, number, _ in rows if chosen] == [material.best]
    shown = np.array(
        [[float(x.replace("\N{MINUS SIGN}", "-").replace("\N{EN DASH}", "nan")) for x in each[1:5]] for each in cells]
    )
    np.testing.assert_allclose(shown, material.parameters, rtol=1e-3)


FORM = {"rms_db": 1.1, "p05_db": 0.6, "p95_db": 1.9}
LEVEL_ONLY = Finding(
    "level_only", "note", "dyke", {"incidence_deg": 31.4, "median_db": -9.1, "p05_db": -10.0, "p95_db": -8.3}
)


def settled(archive):
    """As after a calibration in classes."""
    return ended(configured(archive, objective="classes"), "settled", **dict.fromkeys(archive.materials, "settled"))


def only_dyke(archive, *findings, **changes):
    """Case of one material with these findings on it."""
    archive = replace(archive, materials={"dyke": replace(archive.materials["dyke"], **changes)})
    return changed_findings(archive, *(findings or (determined("dyke"),)))


@pytest.mark.parametrize(
    ("findings", "reason", "bar", "chip", "step"),
    [
        ([determined("dyke")], "settled", "determined", "determined", "use the law, which is in the folder export"),
        ([determined("dyke"), Finding("refuted", "warning", "dyke", FORM)], "settled", "refuted", "law refuted",
         "choose another law for dyke"),
        ([determined("dyke")], "max_runs", "unfinished", "search not finished", "<code>stop.max_runs: 100</code>"),
        ([determined("dyke")], "stagnation", "unfinished", "search not finished", "stop.stagnation_runs: 40</code>"),
        ([Finding("undetermined", "warning", "dyke", {"narrowest_db": 3.2, "known_db": 1.5})], "settled", "nowhere",
         "determined nowhere", "<code>radcal advise small</code>"),
        ([Finding("without_cells", "warning", "dyke")], "settled", "nowhere", "determined nowhere", "larger connected"),
        ([LEVEL_ONLY], "settled", "level", "level only", "add a pass at another incidence"),
        ([Finding("parameters_only", "note", "dyke")], "settled", "parameters", "parameters only",
         "use the parameters"),
        ([RADIOMETRY, Finding("withheld", "refusal", "dyke", {"half_width_db": 1.0})], "settled", "refused", None,
         "<b>Next:</b> set <code>radar.radiometry: sigma0_ref</code></p>"),
    ],
)  # fmt: skip
def test_the_first_screen_says_the_state_and_the_next_step(made, tmp_path, findings, reason, bar, chip, step):
    archive = ended(only_dyke(settled(made.archive), *findings), reason, dyke=reason)
    text = render(tmp_path / "report.html", archive)[0]
    first = text[text.index('<section id="result"') : text.index('<section id="material-dyke"')]
    assert re.findall(r'<p class="verdict is-(\w+)">', first) == [bar]
    assert re.findall(r'<span class="chip">(.*?)</span>', first) == ([chip] if chip else [])
    assert step in first
    assert first.count('class="next"') == 1


def test_materials_that_need_action_come_first_and_the_first_of_them_is_chosen(made, tmp_path):
    archive = changed_findings(
        settled(made.archive), determined("dyke"), Finding("without_cells", "warning", "stem beans")
    )
    text = render(tmp_path / "report.html", archive)[0]
    rows = re.findall(r'<tr class="is-(\w+)"><th scope="row"><input type="radio" .*?id="(\S+)"( checked)?>', text)
    assert rows == [("nowhere", "pick-stem_beans", " checked"), ("determined", "pick-dyke", "")]
    assert re.search(r'<td>1\.5</td><td>23 to 39</td>\s*<td class="words">use the law</td>', text)
    assert ".first:has(#pick-dyke:checked) #law-dyke" in text
    assert '<section class="choice" id="law-dyke"' in text


def test_findings_are_listed_warnings_first_and_notes_folded(made, tmp_path):
    note = Finding("level", "note", "pass 1", {"level_db": 0.1, "p05_db": -0.2, "p95_db": 0.4})
    numbers = {"beyond_db": 2.25, "cause": "unknown"}
    outside = Finding("law_outside_band", "warning", "dyke", numbers)
    findings = (note, determined("dyke"), determined("stem beans"), outside, RADIOMETRY)
    archive = replace(
        changed_findings(made.archive, *findings), notes=(Finding("heading_missing", "warning", "radar.heading_deg"),)
    )
    text, parsed = render(tmp_path / "report.html", archive)
    order = [
        "pass 1: on the fixed materials the image agrees with sigma0_ref",
        "Next: set radar.radiometry: sigma0_ref",
        "warning: radar.heading_deg is not given",
        "leaves the 90 % band of sigma0 by up to 2.2 dB (possible cause: unknown)",
        "dyke: sigma0 is determined to +-1.5 dB",
        "Further findings",
        "by a level of +0.10 dB",
    ]
    places = [parsed.text.index(words) for words in order]
    assert places == sorted(places)
    # the refusal stands in the first line, and the note in the folded part alone
    assert parsed.text.count(order[0]) == parsed.text.count(order[-1]) == 1
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
    addresses = html.document_fromstring(text).xpath("//@src | //@href | //@srcset | //@data | //@action")
    inside = [address for address in addresses if address.startswith("#")]
    ids = re.findall(r' id="(\S+?)"', text)
    assert len(ids) == len(set(ids))
    assert {address[1:] for address in inside} <= set(ids)
    beside = [address for address in addresses if not address.startswith(("data:", "#"))]
    assert all(re.fullmatch(r"figures/\w+\.pdf|[a-z]+/|\w+\.(json|csv|h5)", address) for address in beside)
    assert not re.search(r"https?://|@import|url\(", text)
    # text of others is escaped, wide tables scroll in their own box, and sections without content are left out
    assert "<b>seed</b>" not in text
    assert "synthetic <b>seed</b> 2 & more" in parsed.text
    assert len(re.findall(r'<div class="(?:list )?scroll">\s*<table', text)) == text.count("<table") > 5
    assert "diagnostics" not in ids
    assert "densities" in ids


def test_every_picture_is_embedded(page, pictures):
    found = html.document_fromstring(page[0]).xpath("//img[@alt='an \"alt\" text']/@src")
    opened = [Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))) for address in found]
    assert all(image.format == "WEBP" for image in opened)
    # the law beside the list of materials, the map, the figure of its material
    assert [image.size[0] for image in opened] == [4, 3, 5]
    colours = [f"#{''.join(f'{value:02x}' for value in image.convert('RGB').getpixel((0, 0)))}" for image in opened]
    assert [colours[0], colours[2]] == [COLOURS[1], COLOURS[2]]
    assert "A <caption> & more" in page[1].text


def test_pale_areas_and_a_marker_of_few_pixels_keep_their_colours(tmp_path):
    rng = np.random.default_rng(4)  # edges of lines, blended with a white ground
    lines = np.array([(0, 0, 0), (0, 114, 178), (230, 159, 0), (0, 158, 115), (123, 50, 148), (213, 94, 0)])
    opaque = rng.random((120, 160, 1))
    shades = np.rint(opaque * lines[rng.integers(0, 6, (120, 160))] + (1.0 - opaque) * 255.0).astype(int)
    areas = [(239, 239, 239), (235, 226, 240), (201, 176, 215), (230, 159, 0)]
    places = [np.s_[:40, :40], np.s_[:40, 40:80], np.s_[:40, 80:120], np.s_[60:63, 70:73]]
    for place, colour in zip(places, areas, strict=True):
        shades[place] = colour
    Image.fromarray(shades.astype(np.uint8)).save(tmp_path / "law.png")
    address = _embedded(Figure("law", "", "", "", tmp_path / "law.png", tmp_path / "law.pdf", "dyke"))
    seen = np.array(Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGB"), dtype=int)
    assert len(np.unique(seen.reshape(-1, 3), axis=0)) <= 256
    wrong = np.abs(seen - shades)
    assert wrong.max() <= 16
    assert max(wrong[place].max() for place in places) <= 2


def test_an_interactive_figure_takes_the_place_of_the_static_law(page):
    text = page[0]
    packed = re.search(r'<script type="text/plain" id="plots">(.*?)</script>', text)[1]
    specs = json.loads(gzip.decompress(base64.b64decode(packed)))
    places = re.findall(r'<div class="plot" data-plot="(\S+?)"', text)
    assert sorted(places) == sorted(specs)
    assert re.search(r'<div class="plot" data-plot="law-dyke" role="group" aria-label="[^"]+">\s*<img src=', text)
    assert '<script type="text/plain" id="plotly">library</script>' in text


def test_tables_count_the_runs_and_give_parameters_with_their_intervals(page, made):
    text, parsed = page
    runs = parsed.text[parsed.text.index("The search of a material meets its criterion") :]
    assert re.findall(r"(reference|design|infill|final|total)\s*(\d+)", runs)[:5] == [
        ("reference", "1"), ("design", "4"), ("infill", "2"), ("final", "1"), ("total", "8"),
    ]  # fmt: skip
    assert "more skewed than a skew normal can be" in parsed.text  # at_boundary of the stem beans
    assert "<th>near<br>median</th><th>5 to 95 %</th><th>search</th><th>start</th>" in text
    x = summarise(made.archive)["materials"]["dyke"]["parameters"]["X4"]
    assert f"<td>4.800</td><td>4.00 to 5.90</td><td>{x:.4g}</td><td>" in text


@pytest.mark.parametrize("hidden", [True, False])
def test_a_page_of_one_material_says_what_can_be_checked(made, tmp_path, hidden):
    dyke = made.archive.materials["dyke"]
    dyke = dyke if hidden else replace(dyke, hidden=None)
    archive = ended(replace(made.archive, materials={"dyke": dyke}), "rms")
    text = render(tmp_path / "report.html", archive)[1].text
    assert "tolerance reached" in text
    assert ("This image alone cannot check the law any further" in text) is not hidden
    assert ("The truth behind this synthetic measurement is known" in text) is hidden
    assert "unknown" not in text.replace("(possible cause: unknown)", "")
    text = render(tmp_path / "report.html", ended(archive, "max_runs", dyke="max_runs"))[0]
    assert '<td class="words flag">maximum number of runs</td>' in text


def test_the_truth_is_compared_over_the_incidence_of_all_passes(made, tmp_path):
    """The dyke is seen from 20 to 40 degrees and from 46 to 66 degrees, where its law is further from the truth."""
    seen = [np.linspace(low, low + 20.0, 201, dtype=np.float32) for low in (20.0, 46.0)]
    dyke, first, config = made.archive.materials["dyke"], made.archive.passes["1"], json.loads(made.archive.config)
    targets = {str(k): replace(dyke.target, incidence_deg=angles) for k, angles in enumerate(seen, start=1)}
    spans = np.array([[21.0, 39.0], [47.0, 65.0]])  # 5 to 95 %
    known = first.registered.measurement
    other = replace(known, hidden={"dyke": (known.hidden["dyke"][0] - 50.0, *known.hidden["dyke"][1:])})
    archive = replace(
        configured(
            changed_material(made.archive, "dyke", targets=targets, posterior=posterior(seen_deg=spans)),
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


def test_same_bytes_every_time(made, pictures, page, tmp_path):
    assert render(tmp_path / "elsewhere" / "again.html", made.archive, pictures)[0] == page[0]
    assert [p.name for p in (tmp_path / "elsewhere").iterdir()] == ["again.html"]


def test_numbers():
    plain = {
        "\N{NARROW NO-BREAK SPACE}": " ",
        "\N{MULTIPLICATION SIGN}": "x",
        "\N{MINUS SIGN}": "-",
        "\N{EN DASH}": "?",
    }
    values = [None, float("nan"), 0.0, 12.3456, -0.4557, 123456.7, 9.68e-7, -2.5e12]
    shown = [_number(value).translate(str.maketrans(plain)) for value in values]
    assert shown == ["?", "?", "0", "12.3", "-0.456", "123,457", "9.68 x 10⁻⁷", "-2.50 x 10¹²"]
    assert (_span([2.0, None, 1.5]), _span([None])) == ("1.5 to 2.0", "\N{EN DASH}")


@pytest.mark.parametrize(
    ("form", "reason", "flagged"),
    [
        ({"noticed": True}, "rms", True),
        ({"noticed": False}, "unreachable", False),
        (None, "unreachable", True),
        (None, "rms", False),
    ],
)
def test_a_better_law_outside_of_a_bound_is_suspected_only_where_the_form_is_wrong(
    made, tmp_path, form, reason, flagged
):
    """Or, where the form cannot be tested, after a failed search."""
    nearest = np.array([3.0, 0.0, 4.0, 5.0])
    known = posterior(form=None if form is None else replace(posterior().form, **form), parameters_model=nearest)
    archive = ended(changed_material(made.archive, "dyke", posterior=known), reason, dyke=reason)
    text = render(tmp_path / "report.html", archive)[1].text
    assert ("At a bound: dyke X1. A better law may lie outside the bounds." in text) is flagged
    assert "50.00 (bound)" in text
    assert "0 (bound)" in text.replace("50.00 (bound)", "")


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


def test_provenance_names_date_command_time_and_inputs(build_archive, tmp_path, monkeypatch):
    elevation = tmp_path / "heights.tif"
    elevation.write_bytes(b"heights of the scene")
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "benchmarks/scene.tsv").write_text("s\th:m:s\n95.5\t0:01:35\n")
    archive = build_archive(tmp_path).archive
    monkeypatch.setattr("radcal.page.html.input_files", lambda case: {"scene.elevation": elevation})
    made = provenance_of(archive, tmp_path, "snakemake --cores 2")
    path = tmp_path / "report.html"
    write_report(path, archive, [], made)
    text = Page(path.read_text(encoding="utf-8")).text
    digest = hashlib.sha256(b"heights of the scene").hexdigest()
    assert "report of" + made["date"] in text.replace("\n", "")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", made["date"])
    for words in ("snakemake --cores 2", "1.6 min for all stages", f"heights.tif, SHA-256 {digest}"):
        assert words in text
    monkeypatch.undo()
    # the configured image is not there any more
    gone = configured(archive, measurement={"source": "file", "path": "gone.h5", "scale": "db", "radiometry": "beta0"})
    assert provenance_of(gone, tmp_path, "")["inputs"] == {}

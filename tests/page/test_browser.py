"""The report in headless Chromium: it asks for nothing, nothing fails, and keys, paper and dark screens show it all."""

from dataclasses import replace

import pytest
from archives import changed_findings, determined, ended
from browser import NEEDS_BROWSER
from PIL import Image

from radcal.figures.figures import Figure
from radcal.findings import Finding
from radcal.page.html import write_report

pytestmark = NEEDS_BROWSER
# least ratio of contrast of each text, by WCAG 2.2 (1.4.3); svg is plotly's
CONTRAST = """
(() => {
  const linear = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const parts = (text) => text.match(/[\\d.]+/g).map(Number);
  const behind = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const colour = parts(getComputedStyle(one).backgroundColor);
      if (colour.length === 3 || colour[3] > 0.9) return colour;
    }
    return [255, 255, 255];
  };
  const found = [];
  for (const one of document.querySelectorAll("body *")) {
    if (one.closest("svg, script, style") || !one.checkVisibility()) continue;
    if (![...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim())) continue;
    const [a, b] = [light(parts(getComputedStyle(one).color)), light(behind(one))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < 4.5) found.push(`${one.tagName} ${one.className} ${one.textContent.trim().slice(0, 30)}: ${ratio}`);
  }
  return found;
})()
"""
DRAWN = "[...document.querySelectorAll('[data-plot]')].filter((one) => one.checkVisibility())"


@pytest.fixture(scope="module")
def pages(made, tmp_path_factory):
    """Reports of one material and of two, one of which is not determined."""
    folder = tmp_path_factory.mktemp("report")
    two = changed_findings(made.archive, determined(), Finding("without_cells", "warning", "stem beans"))
    one = ended(replace(two, materials={"dyke": two.materials["dyke"]}), "rms")
    found = {}
    for name, archive in (("one", one), ("two", two)):
        figures = []
        for kind, slug, material in (("residual", "", None), ("law", "_dyke", "dyke"), ("quality", "_dyke", "dyke")):
            png = folder / f"{kind}.png"
            Image.new("RGB", (930, 780), "#c0d0e0").save(png)
            figures.append(Figure(kind + slug, kind, "A caption.", f"Picture of {kind}", png, png, material))
        found[name] = folder / f"{name}.html"
        write_report(found[name], archive, figures)
    return found


@pytest.fixture(params=["one", "two"])
def opened(request, browser, pages):
    browser.media()
    browser.resize(1280, 900)
    browser.open(pages[request.param])
    return browser


def drawn(browser):
    """Scroll through the page until every interactive figure is drawn."""
    browser.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    browser.wait(
        f"(() => {{ const left = {DRAWN}.filter((one) => !one.querySelector('.main-svg'));"
        " left[0]?.scrollIntoView(); return left.length === 0; })()"
    )


def test_nothing_is_asked_for_nothing_fails_and_every_panel_holds_something(opened):
    drawn(opened)
    assert opened.requests() == []
    assert opened.errors() == []
    marks = (
        f"{DRAWN}.map((one) => one.querySelectorAll('.trace, .points path, .shapelayer path, .parcoords, rect').length)"
    )
    counts = opened.evaluate(marks)
    assert counts
    assert min(counts) > 0
    sizes = opened.evaluate("[...document.images].map((one) => one.complete && one.naturalWidth)")
    assert min(sizes) > 1


def test_every_picture_and_input_has_a_name(opened):
    drawn(opened)
    assert opened.evaluate("[...document.images].filter((one) => !one.alt.trim()).length") == 0
    named = "(one) => !one.ariaLabel && !one.labels.length"
    assert opened.evaluate(f"[...document.querySelectorAll('input')].filter({named}).length") == 0
    assert opened.evaluate("[...document.querySelectorAll('[data-plot]')].filter((one) => !one.ariaLabel).length") == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_have_contrast(opened, scheme):
    opened.media("screen", scheme)
    drawn(opened)
    assert opened.evaluate(CONTRAST) == []


def test_the_first_screen_holds_law_images_and_parameters(opened):
    bottoms = "(query) => document.querySelector(query)?.getBoundingClientRect().bottom"
    assert opened.evaluate(f"({bottoms})('.look [data-plot]')") < 900
    if opened.evaluate("document.querySelectorAll('.choice').length") == 0:
        for query in (".look .slider", ".look table"):
            assert opened.evaluate(f"({bottoms})({query!r})") < 900


def test_a_narrow_page_does_not_scroll_sideways_and_unfolds_its_contents_by_a_key(opened):
    opened.resize(390, 844)
    assert opened.evaluate("document.documentElement.scrollWidth") == 390
    shown = "document.querySelector('.contents ul').checkVisibility()"
    assert not opened.evaluate(shown)
    opened.evaluate("document.getElementById('contents').focus()")
    opened.press(" ", 32, " ")
    assert opened.evaluate(shown)
    opened.evaluate("document.querySelector('.contents a[href=\"#pixels\"]').focus()")
    opened.press("Enter", 13, "\r")
    assert opened.evaluate("location.hash") == "#pixels"
    assert abs(opened.evaluate("document.getElementById('pixels').getBoundingClientRect().top")) < 100


def test_the_slider_moves_by_keys_from_measured_to_calibrated(opened):
    opened.evaluate("document.querySelector('.slider input').focus()")
    state = "[...document.querySelectorAll('.compared .shots > div')].map((one) => Number(one.style.opacity))"
    text = "document.querySelector('.slider input').getAttribute('aria-valuetext')"
    assert (opened.evaluate(state), opened.evaluate(text)) == ([1, 0, 0], "measured")
    for _ in range(10):
        opened.press("ArrowRight", 39)
    assert (opened.evaluate(state), opened.evaluate(text)) == ([1, 1, 0], "start")
    opened.press("End", 35)
    assert (opened.evaluate(state), opened.evaluate(text)) == ([1, 1, 1], "calibrated")


def test_keys_choose_a_material_and_sort_a_table(browser, pages):
    browser.resize(1280, 900)
    browser.open(pages["two"])
    chosen = "[...document.querySelectorAll('.choice')].filter((one) => one.checkVisibility()).map((one) => one.id)"
    assert browser.evaluate(chosen) == ["law-stem_beans"]
    browser.evaluate("document.getElementById('pick-stem_beans').focus()")
    browser.press("ArrowDown", 40)
    assert browser.evaluate(chosen) == ["law-dyke"]
    table = "document.querySelector('#search table')"
    browser.evaluate(f"{table}.tHead.rows[0].cells[1].focus()")
    numbers = f"[...{table}.tBodies[0].rows].map((row) => Number(row.cells[1].innerText))"
    before = browser.evaluate(numbers)
    browser.press("Enter", 13, "\r")
    assert browser.evaluate(numbers) == sorted(before)
    browser.press("Enter", 13, "\r")
    assert browser.evaluate(numbers) == sorted(before, reverse=True) != before


def test_paper_has_all_that_is_folded(opened):
    closed = "[...document.querySelectorAll('details')].filter((one) => !one.open).length"
    assert opened.evaluate(closed) > 2
    opened.media("print")
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert opened.evaluate(closed) == 0
    assert opened.evaluate("document.querySelector('#provenance pre').checkVisibility()")
    assert not opened.evaluate("document.querySelector('.contents').checkVisibility()")
    rules = (
        "(query, rule) => [...document.querySelectorAll(query)].every((one) => getComputedStyle(one)[rule] === 'avoid')"
    )
    assert opened.evaluate(f"({rules})('h2, h3', 'breakAfter')")
    assert opened.evaluate(f"({rules})('figure img, .plot, tr', 'breakInside')")
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    assert opened.evaluate(closed) > 2


def test_without_scripts_the_law_and_the_images_are_there(browser, pages):
    browser.media()
    browser.send("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(pages["one"])
        assert browser.evaluate("document.querySelector('.look [data-plot] img').checkVisibility()")
        places = browser.evaluate(
            "[...document.querySelectorAll('.shots img')].map((one) => one.getBoundingClientRect().x)"
        )
        assert places == sorted(set(places))
        assert not browser.evaluate("document.querySelector('.slider').checkVisibility()")
    finally:
        browser.send("Emulation.setScriptExecutionDisabled", value=False)

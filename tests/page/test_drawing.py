"""Script that draws the interactive figures, in headless Chromium on a page of two figures."""

import json

import pytest
from browser import NEEDS_BROWSER

from radcal.page.plots import embedded_library, packed, script

pytestmark = NEEDS_BROWSER
PANELS = {
    "data": [
        {"x": [1, 2], "y": [3, 5], "line": {"color": "#000000"}, "xaxis": f"x{k}", "yaxis": f"y{k}"} for k in (1, 2, 3)
    ],
    "layout": {"height": 300, "grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    | {f"{key}axis{k}": {"title": {"text": key}} for key in "xy" for k in (1, 2, 3)},
}
LOWER = {"data": [{"x": [1, 2], "y": [4, 7]}], "layout": {"height": 120}}
COLOUR = "getComputedStyle(document.querySelector('[data-plot=panels] .js-line')).stroke"
LEFTS = "[...document.querySelectorAll('[data-plot=panels] .xtitle')].map((one) => one.getBoundingClientRect().x)"
WIDTHS = "[...document.querySelectorAll('.main-svg')].map((one) => one.getBoundingClientRect().width)"


@pytest.fixture
def page(browser, tmp_path):
    """Page with a figure in view, and one below it that is not."""
    specs = packed(json.dumps({"panels": PANELS, "lower": LOWER}))
    path = tmp_path / "page.html"
    path.write_text(
        '<!DOCTYPE html><html><body><div data-plot="panels"><img alt="static"></div><div style="height: 3000px"></div>'
        f'<div data-plot="lower"></div><script type="text/plain" id="plots">{specs}</script>'
        f'<script type="text/plain" id="plotly">{embedded_library()}</script><script>{script()}</script></body></html>'
    )
    browser.media()
    browser.resize(1000, 800)
    browser.open(path)
    browser.wait("document.querySelectorAll('.main-svg').length > 0")
    return browser


def test_a_figure_is_drawn_when_it_comes_into_view_and_no_button_sends_data_away(page):
    assert page.evaluate("document.querySelector('[data-plot=panels] img')") is None
    assert page.evaluate("document.querySelector('[data-plot=lower] .main-svg')") is None
    buttons = page.evaluate("[...document.querySelectorAll('.modebar-btn')].map((one) => one.dataset.attr || '')")
    names = page.evaluate("[...document.querySelectorAll('.modebar-btn')].map((one) => one.dataset.title)")
    assert len(buttons) == len(names) == 4
    assert not [name for name in names if "loud" in name or "tudio" in name]
    page.evaluate("document.querySelector('[data-plot=lower]').scrollIntoView()")
    page.wait("document.querySelector('[data-plot=lower] .main-svg')")
    assert page.requests() == []
    assert page.errors() == []


def test_black_is_light_in_the_dark_and_black_again_on_paper(page):
    assert page.evaluate(COLOUR) == "rgb(0, 0, 0)"
    page.media("screen", "dark")
    page.wait(f"{COLOUR} === 'rgb(228, 233, 239)'")
    page.media("print", "dark")
    page.wait(f"{COLOUR} === 'rgb(0, 0, 0)'")


def test_panels_stand_below_each_other_on_a_narrow_page(page):
    assert sorted(set(page.evaluate(LEFTS))) == page.evaluate(LEFTS)
    page.evaluate("document.querySelector('[data-plot=lower]').scrollIntoView()")
    page.wait("document.querySelector('[data-plot=lower] .main-svg')")
    page.resize(390, 800)
    page.wait(f"new Set({LEFTS}.map(Math.round)).size === 1")
    page.wait("document.documentElement.scrollWidth === 390")
    page.wait(f"Math.max(...{WIDTHS}) <= 390")
    page.media("print")
    page.wait(f"Math.max(...{WIDTHS}) <= 390")

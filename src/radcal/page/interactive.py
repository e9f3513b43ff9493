"""Interactive figures of ``report.html``: data and layout for plotly.js, from the data in ``calibration.h5`` alone."""

from __future__ import annotations

import base64
import gzip
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from radcal.figures.drawing import slugs
from radcal.page.plots import PLOTS
from radcal.results.archive import Archive


@dataclass(frozen=True)
class Interactive:
    """Interactive figure of one material.

    Attributes
    ----------
    name : str
        Unique name: kind of the figure and material, as ``law-dyke``.
    material : str
        Material that the figure shows.
    title, caption, alt : str
        Texts for the report: heading, explanation, and description for readers who cannot see the figure.
    spec : dict
        Traces ``data`` and ``layout`` of plotly.js, which JSON can express.
    """

    name: str
    material: str
    title: str
    caption: str
    alt: str
    spec: dict[str, Any]


def interactive(archive: Archive) -> list[Interactive]:
    """Interactive figures of a calibration, material by material; a figure without data is left out.

    Parameters
    ----------
    archive : Archive
        Results of a calibration; the images are not read.
    """
    found = []
    for name, slug in zip(archive.materials, slugs(archive.materials), strict=True):
        for kind, title, alt, draw in PLOTS:
            if (drawn := draw(archive, name)) is not None:
                caption, data, layout = drawn
                spec = {"data": data, "layout": layout}
                found.append(Interactive(f"{kind}-{slug}", name, title, caption, alt.format(name), spec))
    return found


def embedded_library() -> str:
    """plotly.js, compressed by gzip and written in base64; the same bytes every time."""
    text = files("plotly").joinpath("package_data/plotly.min.js").read_bytes()
    return base64.b64encode(gzip.compress(text, 9, mtime=0)).decode("ascii")


def script() -> str:
    """Script of the page that draws the interactive figures (``interactive.js``)."""
    return files("radcal.page").joinpath("interactive.js").read_text(encoding="utf-8")

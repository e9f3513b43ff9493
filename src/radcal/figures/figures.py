"""Figures of a calibration, drawn from the data in ``calibration.h5`` alone; each is a PNG and a PDF file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from radcal.figures.density_figures import densities, histogram, overview, quality
from radcal.figures.drawing import Drawn, slugs, styled
from radcal.figures.fidelity_figures import fidelity
from radcal.figures.front_figures import front
from radcal.figures.held_out_figures import held_out
from radcal.figures.law_figures import cost, law
from radcal.figures.map_figures import images, registration, residual
from radcal.figures.scene_figures import incidence, scene
from radcal.results.archive import Archive
from radcal.storage.files import atomic

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_DPI = 150


@dataclass(frozen=True)
class Figure:
    """Files and texts of a figure.

    Attributes
    ----------
    name : str
        File name without its ending.
    title, caption, alt : str
        Texts for the report: heading, explanation, and description for readers who cannot see the figure.
    png, pdf : Path
        Paths of the PNG file and of the PDF file.
    material : str or None
        Material that the figure shows; None for a figure of the whole case.
    """

    name: str
    title: str
    caption: str
    alt: str
    png: Path
    pdf: Path
    material: str | None = None


def write_figures(archive: Archive, folder: str | Path) -> list[Figure]:
    """Draw every figure of a calibration.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.
    folder : path
        Folder of the files, created if missing. Each file is written atomically.

    Returns
    -------
    list of Figure
        Figures of the whole case, followed by the figures of each material.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    figures: list[Figure] = []
    with styled():

        def add(name: str, title: str, drawn: Drawn | None, material: str | None = None) -> None:
            if drawn is None:
                return
            canvas, caption, alt = drawn
            png, pdf = (_save(canvas, folder / f"{name}.{ending}") for ending in ("png", "pdf"))
            figures.append(Figure(name, title, caption, alt, png, pdf, material))

        add("scene", "The scene", scene(archive))
        add("incidence", "Local incidence and backscatter of the laws", incidence(archive))
        add("images", "Measured, start and calibrated image", images(archive))
        add("registration", "Registration of the measured image onto the simulated one", registration(archive))
        add("residual", "Residual: calibrated minus measured", residual(archive))
        if len(archive.materials) > 1:
            add("overview", "Densities of all materials", overview(archive))
        drawings: tuple[tuple[str, str, Callable[[Archive, str], Drawn | None]], ...] = (
            ("densities", "Density before and after", densities),
            ("law", "Sigma0 and laws", law),
            ("held_out", "Held-out ground", held_out),
            ("cost", "Cost of each run", cost),
            ("front", "Front of the search", front),
            ("fidelity", "Predicted and verified", fidelity),
            ("histogram", "Measured pixels and the design", histogram),
            ("quality", "Fit of a skew normal to the pixels", quality),
        )
        for name, slug in zip(archive.materials, slugs(archive.materials), strict=True):
            for kind, title, draw in drawings:
                add(f"{kind}_{slug}", title, draw(archive, name), name)
    return figures


def _save(canvas: Canvas, path: Path) -> Path:
    ending = path.suffix[1:]
    # no dates or versions, so that the same archive gives the same bytes
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None, "Creator": None, "Producer": None}}[ending]
    # The layout is computed once for both files. With a layout engine, even one without effect, matplotlib draws the
    # figure once more before it saves.
    if (engine := canvas.get_layout_engine()) is not None:
        canvas.set_dpi(_DPI)
        engine.execute(canvas)
        canvas.set_layout_engine(None)
    with atomic(path) as partial:
        canvas.savefig(partial, format=ending, dpi=_DPI, metadata=metadata, facecolor="white")
    return path

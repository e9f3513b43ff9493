"""The figures of a calibration, drawn from ``calibration.h5`` alone, each as PNG and PDF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from radcal.files import atomic
from radcal.report.density_figures import densities, histogram, overview, quality
from radcal.report.drawing import STYLE, CaseData, MaterialData, read_case
from radcal.report.held_out_figures import held_out
from radcal.report.law_figures import cost, law
from radcal.report.map_figures import images, registration, residual
from radcal.report.scene_figures import incidence, scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

__all__ = ["Figure", "write_figures"]

_DPI = 150


@dataclass(frozen=True)
class Figure:
    """A figure on disk.

    Attributes
    ----------
    name : str
        File name without its ending.
    title, caption, alt : str
        Words for a page: heading, explanation, description for who cannot see it.
    png, pdf : Path
        The files.
    material : str or None
        The material it is about, None for the whole case.
    """

    name: str
    title: str
    caption: str
    alt: str
    png: Path
    pdf: Path
    material: str | None = None


def write_figures(archive: str | Path, folder: str | Path) -> list[Figure]:
    """Draw every figure of a calibration.

    Parameters
    ----------
    archive : path
        ``calibration.h5``.
    folder : path
        Where the files go; made if missing. Each file appears complete or not at all.

    Returns
    -------
    list of Figure
        The whole case first, then material by material.
    """
    import matplotlib as mpl

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    case = read_case(archive)
    figures: list[Figure] = []
    with mpl.rc_context(STYLE):

        def add(name: str, title: str, drawn: tuple[Canvas, str, str] | None, material: str | None = None) -> None:
            if drawn is None:
                return
            canvas, caption, alt = drawn
            png, pdf = (_save(canvas, folder / f"{name}.{ending}") for ending in ("png", "pdf"))
            figures.append(Figure(name, title, caption, alt, png, pdf, material))

        add("scene", "The scene", scene(case))
        add("incidence", "Local incidence and what it does to the backscatter", incidence(case))
        add("images", "Measured, start and calibrated image", images(case))
        add("registration", "The measured image brought onto the simulated one", registration(case))
        add("residual", "What is left: calibrated minus measured", residual(case))
        if len(case.materials) > 1:
            add("overview", "Densities of all materials", overview(case))
        drawings: tuple[tuple[str, str, Callable[[CaseData, MaterialData], tuple[Canvas, str, str] | None]], ...] = (
            ("densities", "Density before and after", densities),
            ("law", "The law found", law),
            ("held_out", "Held-out ground", held_out),
            ("cost", "Cost of each run", cost),
            ("histogram", "Measured pixels and the design", histogram),
            ("quality", "How well a skew normal describes the pixels", quality),
        )
        for material in case.materials:
            for kind, title, draw in drawings:
                add(f"{kind}_{material.slug}", title, draw(case, material), material.name)
    return figures


def _save(canvas: Canvas, path: Path) -> Path:
    ending = path.suffix[1:]
    # neither dates nor versions, so that the same archive gives the same bytes
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None, "Creator": None, "Producer": None}}[ending]
    with atomic(path) as partial:
        canvas.savefig(partial, format=ending, dpi=_DPI, metadata=metadata, facecolor="white")
    # what the layout settled for the first file holds for the second; with an engine left, even one that does nothing,
    # matplotlib draws once more before it saves
    canvas.set_layout_engine(None)
    return path

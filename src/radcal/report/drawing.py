"""Shared parts of all figures: colours, type, canvases, and the data read from the archive.

Colours mean the same everywhere (Okabe and Ito's palette, told apart by line style too):
target and measurement black and grey, start orange dashed, calibrated blue, hidden truth
green dotted, tolerance vermilion.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.radar.laws import Law
from radcal.records import read_hdf5
from radcal.report.law_records import read_law

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

Array = NDArray[np.float64]

TARGET: dict[str, Any] = {"color": "#000000", "linewidth": 2.6, "linestyle": "-"}
START: dict[str, Any] = {"color": "#E69F00", "linewidth": 2.0, "linestyle": (0, (5, 2))}
FOUND: dict[str, Any] = {"color": "#0072B2", "linewidth": 2.0, "linestyle": "-"}
HIDDEN: dict[str, Any] = {"color": "#009E73", "linewidth": 2.4, "linestyle": (0, (1, 1.2))}
TOLERANCE: dict[str, Any] = {"color": "#D55E00", "linewidth": 1.6, "linestyle": (0, (6, 2))}
SAMPLING: dict[str, Any] = {"color": "#CC79A7", "linewidth": 2.2, "linestyle": (0, (1, 1.5))}
PALE = "#D0D0D0"
DESIGN = "#56B4E9"
MUTED = "#7A7A7A"

# sixteen fills that differ in lightness too; the map numbers them, colour alone never tells
FILLS = (
    "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#8C8C8C",
    "#332288", "#B7E1B0", "#882255", "#FBD5A5", "#B4C7F0", "#6B4A1B", "#D9D9D9", "#117777",
)  # fmt: skip

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.labelsize": 11.0,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.7,
    "legend.fontsize": 10.0,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "image.interpolation": "auto",
}


@dataclass(frozen=True)
class MaterialData:
    """A calibrated material as the archive has it; arrays as documented there.

    ``start_law_name`` is None where the start is of the law that is calibrated.
    """

    name: str
    slug: str
    law: Law
    start_law: Law
    start_law_name: str | None
    reason: str
    best: int
    rms_sampling: float
    parameters: Array
    dp: Array
    rms: Array
    start: Array
    hidden: Array | None
    target_dp: Array
    incidence_deg: Array
    measured_db: Array
    floor_rms: Array
    mode: tuple[str, ...]
    cost: Array | None
    effective: float
    goodness: Mapping[str, float]
    check: Mapping[str, Any]

    def title(self, text: str = "") -> str:
        """Name and a remark, on two lines if one is too short."""
        name = label(self.name)
        if not text:
            return name
        return f"{name}: {text}" if len(name) <= 16 and len(name) + len(text) < 62 else f"{name}:\n{text}"


@dataclass(frozen=True)
class CaseData:
    """Data of an archive for the figures."""

    case: str
    objective: str
    tolerance: float
    unit: str
    looks: int
    kinds: NDArray[np.str_]
    names: tuple[str, ...]
    materials: tuple[MaterialData, ...]
    images: Mapping[str, NDArray[Any]]
    registration: Mapping[str, NDArray[Any]]
    scene: Mapping[str, NDArray[Any]]
    cell_m: float
    laws: Mapping[str, tuple[Law, list[float]]]


def shortened(name: str, width: int) -> str:
    """Name of at most so many characters."""
    return name if len(name) <= width else f"{name[: width - 1].rstrip()}\N{HORIZONTAL ELLIPSIS}"


def label(name: str, width: int = 44) -> str:
    """Name for a figure: short enough, and no formula."""
    return shortened(name, width).replace("$", r"\$")


def slugs(names: Iterable[str]) -> Iterator[str]:
    """File names, short, plain and each one once."""
    used: set[str] = set()
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:80]
        slug, n = stem, 2
        while slug.lower() in used:
            slug, n = f"{stem}_{n}", n + 1
        used.add(slug.lower())
        yield slug


def short(value: float) -> str:
    """Two significant digits."""
    return f"{value:.2g}"


def read_case(archive: str | Path) -> CaseData:
    """Read ``calibration.h5``."""
    with read_hdf5(archive, "calibration") as file:
        groups = file["materials"]
        materials = tuple(
            MaterialData(
                name=name,
                slug=slug,
                law=read_law(group["parameters"]),
                start_law=read_law(group["start"]),
                start_law_name=_other_law(group),
                reason=str(group.attrs["reason"]),
                best=int(group.attrs["best"]),
                rms_sampling=float(group.attrs["rms_sampling"]),
                hidden=group["hidden"][()] if "hidden" in group else None,
                mode=tuple(group["mode"].asstr()[()]),
                cost=group["cost"][()] if "cost" in group else None,
                effective=float(group.attrs["effective"]),
                check={
                    **{key: np.asarray(values[()], dtype=np.float64) for key, values in group["check"].items()},
                    **{key: float(v) for key, v in group["check"].attrs.items() if key != "sentences"},
                },
                goodness={key: float(group.attrs[f"fit_{key}"]) for key in ("ks", "ks_p", "ad", "ad_p")},
                **{
                    key: np.asarray(group[key][()], dtype=np.float64)
                    for key in (
                        "parameters", "dp", "rms", "start", "target_dp", "incidence_deg", "measured_db", "floor_rms",
                    )
                },
            )
            for (name, group), slug in zip(groups.items(), slugs(groups), strict=True)
        )  # fmt: skip
        return CaseData(
            case=str(file.attrs["case"]),
            objective=str(file.attrs["objective"]),
            tolerance=float(file.attrs["tolerance"]),
            unit=str(file["levels"].attrs["unit"]),
            looks=int(file.attrs["looks"]),
            kinds=file["runs/kind"].asstr()[()].astype(str),
            names=tuple(file["names"].asstr()[()]),
            materials=materials,
            images={name: image[()] for name, image in file["images"].items()},
            registration={name: values[()] for name, values in file["registration"].items()},
            scene={name: values[()] for name, values in file["scene"].items()},
            cell_m=float(file["scene"].attrs["cell_m"]) * int(file["scene"].attrs["step"]),
            laws={name: (read_law(values), [float(x) for x in values[()]]) for name, values in file["laws"].items()},
        )


def _other_law(group: h5py.Group) -> str | None:
    """Name of the start's law where the reference run's X is none of the calibrated law."""
    return str(group["start"].attrs["law"]) if np.isnan(group["parameters"][0]).any() else None


def new_canvas(width: float, height: float, layout: Literal["constrained", "compressed"] = "constrained") -> Canvas:
    """Empty figure of a size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    canvas = Canvas(figsize=(width, height), layout=layout)
    FigureCanvasAgg(canvas)
    return canvas


def add_legend(canvas: Canvas, entries: tuple[Sequence[Any], Sequence[str]], columns: int) -> None:
    """One legend below everything, in as many columns as fit."""
    while True:
        legend = canvas.legend(
            *entries,
            loc="outside lower center",
            ncols=columns,
            handlelength=2.8,
            handleheight=1.0,
            columnspacing=1.4,
        )
        if columns == 1 or legend.get_window_extent().width <= 0.98 * canvas.bbox.width:
            return
        legend.remove()
        columns -= 1


REASONS = {
    "rms": "converged",
    "settled": "stop criterion met",
    "unreachable": "unreachable",
    "stagnation": "stagnated",
    "max_runs": "out of runs",
    "running": "unfinished",
}

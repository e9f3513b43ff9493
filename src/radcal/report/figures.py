"""The figures of a calibration, drawn from ``calibration.h5`` alone, each as PNG and PDF.

Colours mean the same everywhere (Okabe and Ito's palette, told apart by line style too):
target and measurement black and grey, start orange dashed, calibrated blue, hidden truth
green dotted, tolerance vermilion.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.files import atomic
from radcal.radar.laws import LAWS
from radcal.report.summary import law_difference_db

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

__all__ = ["Figure", "write_figures"]

Array = NDArray[np.float64]
_Aspect = Literal["equal", "auto"]

_DPI = 150
_SEED = 4  # of the ten design runs shown
_BOXCAR = 9  # pixels, multilook of the residual
_LARGEST = 1600  # pixels per side of an image shown; larger ones are averaged

_TARGET: dict[str, Any] = {"color": "#000000", "linewidth": 2.6, "linestyle": "-"}
_START: dict[str, Any] = {"color": "#E69F00", "linewidth": 2.0, "linestyle": (0, (5, 2))}
_FOUND: dict[str, Any] = {"color": "#0072B2", "linewidth": 2.0, "linestyle": "-"}
_HIDDEN: dict[str, Any] = {"color": "#009E73", "linewidth": 2.4, "linestyle": (0, (1, 1.2))}
_TOLERANCE: dict[str, Any] = {"color": "#D55E00", "linewidth": 1.6, "linestyle": (0, (6, 2))}
_SAMPLING: dict[str, Any] = {"color": "#CC79A7", "linewidth": 2.2, "linestyle": (0, (1, 1.5))}
_PALE = "#D0D0D0"
_DESIGN = "#56B4E9"
_MUTED = "#7A7A7A"

# sixteen fills that differ in lightness too; the map numbers them, colour alone never tells
_FILLS = (
    "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#8C8C8C",
    "#332288", "#B7E1B0", "#882255", "#FBD5A5", "#B4C7F0", "#6B4A1B", "#D9D9D9", "#117777",
)  # fmt: skip

_STYLE: Any = {
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
    "figure.constrained_layout.use": True,
    "image.interpolation": "auto",
}


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


@dataclass(frozen=True)
class _Material:
    """A calibrated material as the archive has it; arrays as documented there."""

    name: str
    slug: str
    law: str
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

    def title(self, text: str = "") -> str:
        """Name and a remark, on two lines if one is too short."""
        name = _label(self.name)
        if not text:
            return name
        return f"{name}: {text}" if len(name) <= 16 and len(name) + len(text) < 62 else f"{name}:\n{text}"


@dataclass(frozen=True)
class _Case:
    """What the figures need of an archive."""

    case: str
    tolerance: float
    looks: int
    kinds: NDArray[np.str_]
    names: tuple[str, ...]
    materials: tuple[_Material, ...]
    images: Mapping[str, NDArray[Any]]
    registration: Mapping[str, NDArray[Any]]


def _shortened(name: str, width: int) -> str:
    return name if len(name) <= width else f"{name[: width - 1].rstrip()}\N{HORIZONTAL ELLIPSIS}"


def _label(name: str, width: int = 44) -> str:
    """Name for a figure: short enough, and no formula."""
    return _shortened(name, width).replace("$", r"\$")


def _slugs(names: Iterable[str]) -> Iterator[str]:
    """File names, short, plain and each one once."""
    used: set[str] = set()
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:80]
        slug, n = stem, 2
        while slug.lower() in used:
            slug, n = f"{stem}_{n}", n + 1
        used.add(slug.lower())
        yield slug


def _read(archive: str | Path) -> _Case:
    with h5py.File(archive, "r") as file:
        groups = file["materials"]
        materials = tuple(
            _Material(
                name=name,
                slug=slug,
                law=str(group.attrs["law"]),
                reason=str(group.attrs["reason"]),
                best=int(group.attrs["best"]),
                rms_sampling=float(group.attrs["rms_sampling"]),
                hidden=group["hidden"][()] if "hidden" in group else None,
                mode=tuple(group["mode"].asstr()[()]),
                **{
                    key: np.asarray(group[key][()], dtype=np.float64)
                    for key in (
                        "parameters", "dp", "rms", "start", "target_dp", "incidence_deg", "measured_db", "floor_rms",
                    )
                },
            )
            for (name, group), slug in zip(groups.items(), _slugs(groups), strict=True)
        )  # fmt: skip
        return _Case(
            case=str(file.attrs["case"]),
            tolerance=float(file.attrs["tolerance"]),
            looks=int(file.attrs["looks"]),
            kinds=file["runs/kind"].asstr()[()].astype(str),
            names=tuple(file["names"].asstr()[()]),
            materials=materials,
            images={name: image[()] for name, image in file["images"].items()},
            registration={name: values[()] for name, values in file["registration"].items()},
        )


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
    case = _read(archive)
    figures: list[Figure] = []
    with mpl.rc_context(_STYLE):

        def add(name: str, title: str, drawn: tuple[Canvas, str, str] | None, material: str | None = None) -> None:
            if drawn is None:
                return
            canvas, caption, alt = drawn
            png, pdf = (_save(canvas, folder / f"{name}.{ending}") for ending in ("png", "pdf"))
            figures.append(Figure(name, title, caption, alt, png, pdf, material))

        add("images", "Measured, start and calibrated image", _images(case))
        add("registration", "The measured image brought onto the simulated one", _registration(case))
        add("residual", "What is left: calibrated minus measured", _residual(case))
        if len(case.materials) > 1:
            add("overview", "Densities of all materials", _overview(case))
        drawings: tuple[tuple[str, str, Callable[[_Case, _Material], tuple[Canvas, str, str]]], ...] = (
            ("densities", "Density before and after", _densities),
            ("law", "The law found", _law),
            ("cost", "Cost of each run", _cost),
            ("histogram", "Measured pixels and the design", _histogram),
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
    # what the layout settled for the first file holds for the second
    canvas.set_layout_engine("none")
    return path


def _canvas(width: float, height: float, layout: Literal["constrained", "compressed"] = "constrained") -> Canvas:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    canvas = Canvas(figsize=(width, height), layout=layout)
    FigureCanvasAgg(canvas)
    return canvas


# --- densities ------------------------------------------------------------------------------


def _reach(dp: Array) -> tuple[float, float]:
    mean, sd, _ = skewnormal.centred(dp)
    return float(mean), float(sd)


class _Densities:
    """An axis of densities: the target in its middle, others as far as they can be shown."""

    def __init__(self, axes: Axes, material: _Material) -> None:
        self._axes = axes
        self._dp = material.target_dp
        mean, sd = _reach(self._dp)
        values = material.measured_db[np.isfinite(material.measured_db)]
        self._low, self._high = mean - 4.0 * sd, mean + 4.0 * sd
        self._limits = (mean - 14.0 * sd, mean + 14.0 * sd)
        inside = values[(values > self._limits[0]) & (values < self._limits[1])]
        self.outside = 0
        self.clipped = 0
        peak = float(skewnormal.density(self._grid(self._dp), self._dp).max())
        if inside.size:
            bins = int(np.clip(np.sqrt(inside.size), 8, 36))
            heights, edges = np.histogram(inside, bins=bins, density=True)
            axes.stairs(heights, edges, fill=True, color=_PALE, label="measured pixels")
            peak = max(peak, float(heights.max()))
            self._low, self._high = min(self._low, inside.min()), max(self._high, inside.max())
        self._cap = 2.2 * peak
        self._tops = [peak]

    @staticmethod
    def _grid(dp: Array) -> Array:
        mean, sd = _reach(dp)
        return np.linspace(mean - 6.0 * sd, mean + 6.0 * sd, 601)

    def draw(self, dp: Array, label: str | None, style: Mapping[str, Any]) -> None:
        mean, sd = _reach(dp)
        if mean + sd < self._limits[0] or mean - sd > self._limits[1]:
            self.outside += 1
            self._axes.plot([], [], label=label, **style)
            return
        self._low = max(self._limits[0], min(self._low, mean - 3.0 * sd))
        self._high = min(self._limits[1], max(self._high, mean + 3.0 * sd))
        grid = self._grid(dp)
        values = skewnormal.density(grid, dp)
        top = float(values.max())
        grid, values = grid[values > 2e-4 * top], values[values > 2e-4 * top]
        self.clipped += top > self._cap
        self._tops.append(min(top, self._cap))
        self._axes.plot(grid, values, label=label, **style)

    def finish(self) -> None:
        self._axes.set_xlim(self._low, self._high)
        self._axes.set_ylim(0.0, 1.06 * max(self._tops))

    def remark(self) -> str:
        """Return a sentence on what the axes could not show."""
        parts = []
        if self.outside:
            parts.append(f"{self.outside} lie outside the axis" if self.outside > 1 else "one lies outside the axis")
        if self.clipped:
            parts.append(
                f"{self.clipped} are higher than the axis" if self.clipped > 1 else "one is higher than the axis"
            )
        return f" Of the curves, {' and '.join(parts)}." if parts else ""


def _legend(canvas: Canvas, entries: tuple[Sequence[Any], Sequence[str]], columns: int) -> None:
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


def _histogram(case: _Case, material: _Material) -> tuple[Canvas, str, str]:
    canvas = _canvas(6.2, 4.2)
    axes = canvas.subplots()
    panel = _Densities(axes, material)
    design = np.flatnonzero(case.kinds == "design")
    chosen = np.random.default_rng(_SEED).choice(design, size=min(10, design.size), replace=False)
    for n, run in enumerate(np.sort(chosen)):
        label = f"{chosen.size} runs of the design" if n == 0 else None
        panel.draw(material.dp[run], label, {"color": _DESIGN, "linewidth": 1.1, "alpha": 0.9})
    panel.draw(material.target_dp, "target: fitted skew normal", _TARGET | {"linewidth": 3.2})
    panel.finish()
    axes.set_title(material.title())
    axes.set_xlabel("backscatter [dB]")
    axes.set_ylabel("density [1/dB]")
    _legend(canvas, axes.get_legend_handles_labels(), 3)
    caption = (
        f"Grey: the {material.measured_db.size:,} measured pixels of {material.name}. Black: the skew normal fitted to "
        f"them, which is the target. Thin: the densities of {chosen.size} of the {design.size} runs of the design, "
        f"drawn at random (seed {_SEED}).{panel.remark()}"
    )
    alt = f"Histogram of {material.name}'s measured backscatter in dB, its fitted density and those of some runs."
    return canvas, caption, alt


def _densities(case: _Case, material: _Material) -> tuple[Canvas, str, str]:  # noqa: ARG001 - one shape for all
    canvas = _canvas(6.2, 4.2)
    axes = canvas.subplots()
    panel = _before_after(axes, material)
    axes.set_title(material.title(f"rms {_short(material.rms[material.best])} 1/dB"))
    axes.set_xlabel("backscatter [dB]")
    axes.set_ylabel("density [1/dB]")
    _legend(canvas, axes.get_legend_handles_labels(), 4)
    caption = (
        "Density of the backscatter at the starting parameters (orange, dashed), after calibration (blue) and in the "
        "measurement (black: fitted; grey: its pixels). Where blue lies on black the distributions agree."
        + panel.remark()
    )
    alt = f"Densities of {material.name}'s backscatter in dB: target, start and calibrated."
    return canvas, caption, alt


def _before_after(axes: Axes, material: _Material) -> _Densities:
    panel = _Densities(axes, material)
    panel.draw(material.target_dp, "target", _TARGET | {"linewidth": 4.5})
    panel.draw(material.dp[0], "start", _START)
    panel.draw(material.dp[material.best], "calibrated", _FOUND)
    panel.finish()
    return panel


def _overview(case: _Case) -> tuple[Canvas, str, str]:
    n = len(case.materials)
    columns = 2 if n <= 4 else 3 if n <= 9 else 4
    rows = -(-n // columns)
    canvas = _canvas(9.5, 2.2 * rows + 1.0)
    grid = canvas.subplots(rows, columns, squeeze=False).ravel()
    outside = 0
    for axes, material in zip(grid, case.materials, strict=False):
        panel = _before_after(axes, material)
        outside += bool(panel.outside or panel.clipped)
        width = 88 // columns
        lines = textwrap.wrap(_shortened(material.name, 2 * width - 4), width)
        axes.set_title(
            "\n".join(line.replace("$", r"\$") for line in lines)
            + f"\nrms {_short(material.rms[material.best])}: {_REASONS.get(material.reason, material.reason)}",
            fontsize=10.0,
        )
        axes.tick_params(labelsize=9.5)
    for axes in grid[n:]:
        axes.set_axis_off()
    for axes in grid[max(0, n - columns) : n]:
        axes.set_xlabel("backscatter [dB]")
    for axes in grid[:n:columns]:
        axes.set_ylabel("density [1/dB]")
    _legend(canvas, grid[0].get_legend_handles_labels(), 4)
    caption = (
        "Density of each material at the starting parameters (orange, dashed), after calibration (blue) and in the "
        "measurement (black: fitted; grey: its pixels); rms in 1/dB."
        + (f" In {outside} of them a curve leaves the axes." if outside else "")
    )
    return canvas, caption, f"Small densities of {n} materials: target, start and calibrated."


_REASONS = {
    "rms": "converged",
    "unreachable": "unreachable",
    "stagnation": "stagnated",
    "max_runs": "out of runs",
    "running": "unfinished",
}


def _short(value: float) -> str:
    return f"{value:.2g}"


# --- cost -----------------------------------------------------------------------------------


def _cost(case: _Case, material: _Material) -> tuple[Canvas, str, str]:
    from matplotlib.ticker import MaxNLocator

    canvas = _canvas(6.2, 4.8)
    axes = canvas.subplots()
    rms = material.rms
    runs = np.arange(rms.size)
    positive = np.concatenate([rms[rms > 0], [case.tolerance, material.rms_sampling]])
    positive = positive[np.isfinite(positive) & (positive > 0)]
    # a cost of exactly 0 has no place on a logarithmic axis: it is drawn on its lower edge
    bottom = float(positive.min()) / 3.0
    shown = np.where(rms > 0, rms, bottom)

    axes.step(runs, np.minimum.accumulate(shown), where="post", color="black", linewidth=1.6, label="best so far")
    ended = np.zeros(rms.size, dtype=bool)
    infill = np.flatnonzero(case.kinds == "infill")
    ended[infill[[mode == "ended" for mode in material.mode]]] = True
    markers: tuple[tuple[str, NDArray[np.bool_], dict[str, Any]], ...] = (
        ("reference (start)", case.kinds == "reference", {"color": _START["color"], "marker": "s", "s": 62}),
        ("design", case.kinds == "design", {"color": _DESIGN, "marker": "o", "s": 30}),
        ("infill", (case.kinds == "infill") & ~ended, {"color": _FOUND["color"], "marker": "^", "s": 40}),
        ("infill after it ended", ended, {"color": _PALE, "marker": "^", "s": 26}),
    )
    for label, which, style in markers:
        if which.any():
            axes.scatter(
                runs[which], shown[which], label=label, edgecolors="black", linewidths=0.4, zorder=3, clip_on=False,
                **style,
            )  # fmt: skip
    axes.axhline(case.tolerance, label=f"tolerance {_short(case.tolerance)}", **_TOLERANCE)
    pixels = material.measured_db.size
    if material.rms_sampling > 0:
        axes.axhline(material.rms_sampling, label=f"what {pixels:,} pixels can tell", **_SAMPLING)
    floor = np.full(rms.size, np.nan)
    floor[infill] = material.floor_rms
    known = np.isfinite(floor) & (floor > 0)
    if known.any():
        axes.plot(runs[known], np.maximum(floor[known], bottom), color=_MUTED, linestyle="none", marker="_",
                  markersize=9, markeredgewidth=1.8, label="floor seen by the surrogate")  # fmt: skip
    axes.set_yscale("log")
    top = max(float(shown.max()), float(positive.max()))
    axes.set_ylim(bottom, 2.0 * top)
    axes.set_xlim(-0.5, max(rms.size - 0.5, 1.0))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_title(material.title(f"best rms {_short(rms[material.best])} 1/dB in run {material.best}"))
    axes.set_xlabel("run (0: reference)")
    axes.set_ylabel("difference of the densities, rms [1/dB]")
    _legend(canvas, axes.get_legend_handles_labels(), 3)
    caption = (
        "Root mean square difference between the simulated and the target density, run by run; the line is the best so "
        f"far. Below the dotted line ({_short(material.rms_sampling)} 1/dB) a smaller cost is numerical convergence: "
        f"another sample of {pixels:,} pixels would move the target itself by about that much."
    )
    if known.any():
        caption += " Short bars: the smallest cost that the surrogate, in favour, still holds possible."
    if not np.all(rms > 0):
        caption += " Runs on the lower edge have a cost of 0."
    return canvas, caption, f"Cost of each run of {material.name} on a logarithmic axis, with the tolerance."


# --- laws -----------------------------------------------------------------------------------


def _law(case: _Case, material: _Material) -> tuple[Canvas, str, str]:  # noqa: ARG001 - one shape for all
    shares = (4.0, 1.0) if material.hidden is None else (4.0, 1.4, 1.0)
    canvas = _canvas(6.2, 4.2 + 0.4 * sum(shares[1:]))
    panels = canvas.subplots(len(shares), 1, sharex=True, height_ratios=shares)
    upper, lower = panels[0], panels[-1]
    law = LAWS[material.law]
    low, high = (float(v) for v in np.percentile(material.incidence_deg, [5.0, 95.0]))
    phi, seen = np.linspace(0.0, 90.0, 361), np.linspace(low, high, 101)
    found = material.parameters[material.best]
    curves: list[tuple[str, Array, dict[str, Any]]] = [("start", material.start, _START), ("calibrated", found, _FOUND)]
    if material.hidden is not None:
        curves.append(("hidden truth", material.hidden, _HIDDEN))
    for axes in panels:
        axes.axvspan(low, high, color="#EFEFEF", zorder=0, linewidth=0)
    for label, parameters, style in curves:
        upper.plot(phi, law(np.radians(phi), parameters), **style | {"linewidth": 1.0})
        upper.plot(seen, law(np.radians(seen), parameters), label=label, **style | {"linewidth": 3.2})
    upper.margins(x=0)
    if material.hidden is None:
        upper.set_title(material.title("no truth to compare with"))
        remark = "The image alone cannot tell whether the law found is right."
    else:
        difference = law_difference_db(material.law, found, material.hidden, material.incidence_deg)
        for angles, width in ((phi, 1.0), (seen, 3.2)):
            gap = law(np.radians(angles), found) - law(np.radians(angles), material.hidden)
            panels[1].plot(angles, gap, **_FOUND | {"linewidth": width})
        panels[1].axhline(0.0, **_HIDDEN)
        reach = 1.3 * max(difference, 0.05)
        panels[1].set_ylim(-reach, reach)
        panels[1].set_ylabel("found minus\ntruth [dB]")
        upper.set_title(material.title(f"at most {difference:.2g} dB from the truth over the incidence seen"))
        remark = (
            f"Over the incidence seen the law found differs from the hidden truth (green, dotted; middle panel) by at "
            f"most {difference:.2g} dB."
        )
    upper.set_ylabel("\N{GREEK SMALL LETTER SIGMA}\N{SUPERSCRIPT ZERO} [dB]")
    lower.hist(material.incidence_deg, bins=np.arange(0.0, 90.5, 1.0).tolist(), color=_MUTED)
    lower.set_ylabel("pixels")
    lower.set_xlabel("local incidence [deg]")
    lower.set_xlim(0.0, 90.0)
    lower.set_xticks(np.arange(0, 91, 15).tolist())
    _legend(canvas, upper.get_legend_handles_labels(), 3)
    caption = (
        "Backscatter against local incidence at the starting parameters (orange, dashed) and as found (blue). Shaded, "
        f"thick: {low:.1f} to {high:.1f} deg, where 90 % of the material's pixels lie (histogram below); outside, the "
        f"law is an extrapolation. {remark}"
    )
    return canvas, caption, f"Backscatter laws of {material.name} in dB against local incidence in degrees."


# --- images ---------------------------------------------------------------------------------


def _power(image_db: NDArray[Any]) -> tuple[Array, NDArray[np.bool_]]:
    """Linear power, 0 where there is none, and where there is some."""
    valid = np.isfinite(image_db)
    return np.where(valid, 10.0 ** (np.where(valid, image_db, 0.0).astype(np.float64) / 10.0), 0.0), valid


def _db(power: Array, valid: NDArray[np.bool_]) -> Array:
    good = valid & (power > 0)
    return np.where(good, 10.0 * np.log10(np.where(good, power, 1.0)), np.nan)


def _blocks(values: NDArray[Any], k: int) -> NDArray[Any]:
    """Sums over blocks of k x k; what is left over at the end is dropped."""
    rows, columns = values.shape[0] // k, values.shape[1] // k
    return np.asarray(values[: rows * k, : columns * k].reshape(rows, k, columns, k).sum(axis=(1, 3)))


def _factor(shape: tuple[int, ...]) -> int:
    k = -(-max(shape) // _LARGEST)
    return k if min(shape) >= k else 1


def _shown(image_db: NDArray[Any]) -> NDArray[Any]:
    """Image for the page: large ones averaged in power."""
    k = _factor(image_db.shape)
    if k == 1:
        return image_db
    power, valid = _power(image_db)
    count = _blocks(valid.astype(np.float64), k)
    return _db(_blocks(power, k) / np.maximum(count, 1.0), count > 0)


def _panels(shape: tuple[int, ...], n: int, below: float = 0.0) -> tuple[Canvas, list[Axes], bool, _Aspect]:
    """Panels beside each other, or stacked if the image is wide; extreme images are stretched."""
    ratio = shape[0] / shape[1]
    aspect: _Aspect = "equal" if 0.2 <= ratio <= 2.5 else "auto"
    ratio = float(np.clip(ratio, 0.2, 2.5))
    width = 9.5
    if ratio < 0.6:
        canvas = _canvas(width, n * ((width - 1.9) * ratio + 0.55) + 0.45 + below, "compressed")
        axes = canvas.subplots(n, 1, sharex=True, sharey=True, squeeze=False)
    else:
        canvas = _canvas(width, (width - 1.9) / n * ratio + 0.85 + below, "compressed")
        axes = canvas.subplots(1, n, sharex=True, sharey=True, squeeze=False)
    for panel in axes.ravel():
        panel.grid(False)
        panel.set_facecolor("#F6E9D8")
        for spine in panel.spines.values():
            spine.set_visible(True)
    return canvas, list(axes.ravel()), ratio < 0.6, aspect


def _axis_labels(panels: Sequence[Axes], stacked: bool) -> None:
    for panel in panels if not stacked else panels[-1:]:
        panel.set_xlabel("azimuth [pixel]")
    for panel in panels if stacked else panels[:1]:
        panel.set_ylabel("slant range [pixel]")
    for panel in panels:
        panel.locator_params(axis="x", nbins=4, integer=True)
        panel.locator_params(axis="y", nbins=5, integer=True)


def _extent(shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    return (-0.5, shape[1] - 0.5, shape[0] - 0.5, -0.5)


def _images(case: _Case) -> tuple[Canvas, str, str] | None:
    titles = {"measured_db": "measured", "reference_db": "start", "calibrated_db": "calibrated"}
    there = [key for key in titles if key in case.images]
    if not there:
        return None
    first = case.images[there[0]]
    finite = first[np.isfinite(first)]
    low, high = (float(v) for v in np.percentile(finite, [1.0, 99.5])) if finite.size else (-30.0, 0.0)
    high = max(high, low + 1.0)
    canvas, panels, stacked, aspect = _panels(first.shape, len(there))
    shown = None
    for panel, key in zip(panels, there, strict=True):
        shown = panel.imshow(
            _shown(case.images[key]), cmap="gray", vmin=low, vmax=high, aspect=aspect, extent=_extent(first.shape)
        )
        panel.set_title(titles[key])
    if shown is not None:
        bar = canvas.colorbar(shown, ax=panels, extend="both", fraction=0.05, pad=0.02, aspect=30)
        bar.set_label("backscatter [dB]")
    _axis_labels(panels, stacked)
    k = _factor(first.shape)
    caption = (
        "The three images in one gray scale (1 to 99.5 % of the measured pixels), near range on top. "
        "The calibrated image has speckle of its own: compare levels and textures, not pixels."
    )
    if finite.size < first.size:
        caption += f" {first.size - finite.size:,} measured pixels have no value (pale)."
    if k > 1:
        caption += f" Shown as means over {k} x {k} pixels."
    return canvas, caption, "Measured, starting and calibrated radar image side by side in the same gray scale."


def _registration(case: _Case) -> tuple[Canvas, str, str] | None:
    if not case.registration or "reference_db" not in case.images:
        return None
    simulated = case.images["reference_db"]
    field = case.registration["displacement_px"].astype(np.float64)
    canvas, panels, stacked, aspect = _panels(simulated.shape, 3)
    extent, k = _extent(simulated.shape), _factor(simulated.shape)
    # squares of one image between squares of the other: roads and borders must go on across them
    rows, columns = np.indices(simulated.shape) // (max(simulated.shape) // 9)
    squares = (rows + columns) % 2 == 0
    levelled = _levelled(simulated)
    measured = {"as measured": case.registration["unregistered_db"], "registered": case.images["measured_db"]}
    for panel, (title, image) in zip(panels, measured.items(), strict=False):
        both = np.where(squares, levelled, _levelled(image))
        panel.imshow(both[::k, ::k], cmap="gray", vmin=-2.0, vmax=2.0, aspect=aspect, extent=extent)
        panel.set_title(title)
    length = np.hypot(*field)
    largest = max(float(length.max()), 1e-6)
    shown = panels[2].imshow(length[::k, ::k], cmap="viridis", vmin=0.0, aspect=aspect, extent=extent)
    step = max(simulated.shape) // 14
    y, x = np.mgrid[step // 2 : simulated.shape[0] : step, step // 2 : simulated.shape[1] : step]
    arrows = {"color": "white", "angles": "xy", "scale_units": "xy", "scale": largest / step, "width": 0.005}
    panels[2].quiver(x, y, field[1][y, x], field[0][y, x], **arrows)
    panels[2].set_title("displacement")
    bar = canvas.colorbar(shown, ax=panels, fraction=0.05, pad=0.02, aspect=30)
    bar.set_label("displacement [pixel]")
    _axis_labels(panels, stacked)
    caption = (
        "Squares of the starting simulation between squares of the measured image, before and after registration, each "
        "image in a gray scale of its own and averaged over 5 x 5 pixels: borders must go on across the squares. "
        f"Right: where each pixel was fetched from; the longest arrow stands for {largest:.1f} pixels."
    )
    if "misregistration_px" in case.registration:
        error = np.hypot(*(field - case.registration["misregistration_px"])).mean()
        caption += f" The true displacement of this synthetic image is known: the mean error is {error:.2f} pixels."
    alt = "Chequerboards of simulated and measured image before and after registration, and the displacement field."
    return canvas, caption, alt


def _levelled(image_db: NDArray[Any]) -> Array:
    """Image averaged over 5 x 5 pixels, brought to zero median and unit spread."""
    from scipy.ndimage import uniform_filter

    power, valid = _power(image_db)
    count = uniform_filter(valid.astype(np.float64), 5)
    smooth = _db(uniform_filter(power, 5) / np.maximum(count, 1e-9), count > 0.02)
    low, middle, high = np.nanpercentile(smooth, [16.0, 50.0, 84.0])
    return np.asarray((smooth - middle) / max(0.5 * float(high - low), 1e-6))


def _residual(case: _Case) -> tuple[Canvas, str, str] | None:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch
    from scipy.ndimage import uniform_filter
    from scipy.special import polygamma

    if not {"measured_db", "calibrated_db", "material"} <= case.images.keys():
        return None
    pixels = case.images["calibrated_db"] - case.images["measured_db"]
    # where no material is seen the simulation holds noise alone: nothing there was compared
    valid = np.isfinite(pixels) & np.isfinite(case.images.get("incidence_deg", pixels))
    share = uniform_filter(valid.astype(np.float32), _BOXCAR, mode="constant")
    total = uniform_filter(np.where(valid, pixels, 0.0), _BOXCAR, mode="constant")
    enough = valid & (share > 0.25)
    difference = np.where(enough, total / np.where(enough, share, 1.0), np.nan)
    k = _factor(difference.shape)
    finite = difference[np.isfinite(difference)]
    limit = float(np.clip(np.ceil(np.percentile(np.abs(finite), 98.0)), 1.0, 40.0)) if finite.size else 1.0

    material = case.images["material"].astype(np.int64)
    present = [number for number in np.unique(material) if 0 < number <= len(case.names)]
    calibrated_names = {item.name for item in case.materials}
    labels = [
        f"{number}  {_label(case.names[number - 1], 34)}" + (" *" if case.names[number - 1] in calibrated_names else "")
        for number in present
    ]
    columns = max(1, min(4, int(105 / (max(map(len, labels), default=1) + 9))))
    rows = -(-(len(labels) + 1) // columns)
    canvas, panels, stacked, aspect = _panels(difference.shape, 2, below=0.215 * rows)
    extent = _extent(difference.shape)
    shown = panels[0].imshow(
        difference[k // 2 :: k, k // 2 :: k], cmap="RdBu_r", vmin=-limit, vmax=limit, aspect=aspect, extent=extent
    )
    panels[0].set_title("calibrated minus measured")
    bar = canvas.colorbar(shown, ax=panels[0], extend="both", fraction=0.05, pad=0.02, aspect=30)
    bar.set_label("difference [dB]")

    colours = ["#FFFFFF", *(_FILLS[(number - 1) % len(_FILLS)] for number in range(1, len(case.names) + 1))]
    norm = BoundaryNorm((np.arange(len(colours) + 1) - 0.5).tolist(), len(colours))
    panels[1].imshow(
        material[k // 2 :: k, k // 2 :: k], cmap=ListedColormap(colours), norm=norm, aspect=aspect, extent=extent,
        interpolation="nearest",
    )  # fmt: skip
    panels[1].set_title("materials")
    places: list[tuple[int, int]] = []
    for number in present:
        places.append(_middle(material == number, places))
        row, column = places[-1]
        panels[1].text(
            column, row, str(number), ha="center", va="center", fontsize=10.0, fontweight="bold",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "black", "linewidth": 0.6},
        )  # fmt: skip
    if not stacked:
        canvas.set_layout_engine("compressed", wspace=0.05, h_pad=0.08)
    handles = [Patch(facecolor=colours[number], edgecolor="black", linewidth=0.5) for number in present]
    handles.append(Patch(facecolor="#FFFFFF", edgecolor="black", linewidth=0.5))
    _legend(canvas, (handles, [*labels, "mixed or unseen"]), columns)
    _axis_labels(panels, stacked)
    # Oliver and Quegan 2004: variance of log intensity is trigamma(looks); neighbours are correlated, so at least
    speckle = 10.0 / np.log(10.0) * np.sqrt(2.0 * float(polygamma(1, case.looks))) / _BOXCAR
    caption = (
        f"Left: calibrated minus measured image, mean of the dB values over {_BOXCAR} x {_BOXCAR} pixels; red: "
        f"too bright, blue: too dark. With {case.looks} looks speckle alone leaves a standard deviation of at least "
        f"{speckle:.2g} dB there. White: nothing of the scene, or no measurement. Right: the materials of the "
        "scene; those marked * were calibrated, the others kept their laws."
    )
    if stacked:
        caption = caption.replace("Left:", "Above:").replace("Right:", "Below:")
    return canvas, caption, "Map of the difference between calibrated and measured image in dB, and the material map."


def _middle(inside: NDArray[np.bool_], taken: Sequence[tuple[int, int]] = ()) -> tuple[int, int]:
    """Row and column of a point well inside a region and away from points already taken."""
    from scipy.ndimage import distance_transform_cdt

    k = max(1, max(inside.shape) // 400)
    coarse = inside[k // 2 :: k, k // 2 :: k]
    if not coarse.any():
        k, coarse = 1, inside
    depth = distance_transform_cdt(np.pad(coarse, 1), metric="taxicab")[1:-1, 1:-1]
    rows, columns = np.nonzero(depth >= 0.6 * depth.max())
    merit = depth[rows, columns] / depth.max()
    merit = merit - 0.2 * np.hypot((rows - rows.mean()) / coarse.shape[0], (columns - columns.mean()) / coarse.shape[1])
    for row, column in taken:
        gap = np.hypot((rows - row / k) / coarse.shape[0], (columns - column / k) / coarse.shape[1])
        merit = merit - 2.0 * np.maximum(0.0, 1.0 - gap / 0.08)
    best = int(np.argmax(merit))
    return int(rows[best]) * k + k // 2, int(columns[best]) * k + k // 2

"""Draw the concepts of the pages.

python docs/drawings.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch, Polygon
from scipy.special import gammaln, polygamma

from radcal.sections.target import Uncertainty

HERE = Path(__file__).parent
BLUE, ORANGE, GREY, GREEN = "#0072B2", "#D55E00", "#6b6b6b", "#007a5a"
DB = 10.0 / np.log(10.0)
plt.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False, "svg.fonttype": "path"})


def speckle(level_db: np.ndarray, mean_db: np.ndarray, looks: float) -> np.ndarray:
    """Density over a level [dB] of speckle about mean power [dB]: the logarithm of a gamma variate."""
    x = (level_db - mean_db) / DB
    return np.exp(looks * np.log(looks) - gammaln(looks) + looks * (x - np.exp(x))) / DB


def histogram() -> None:
    """Two laws with nearly one histogram, which bins of incidence tell apart."""
    phi, level = np.linspace(25.0, 45.0, 201), np.linspace(-26.0, 2.0, 281)
    falling = -9.0 - 0.28 * (phi - 35.0)
    # looks with which a constant has the variance of the falling law's pixels
    looks = np.linspace(1.5, 4.0, 2501)
    wanted = polygamma(1, 4.0) * DB**2 + falling.var()
    fewer = float(looks[np.argmin(abs(polygamma(1, looks) * DB**2 - wanted))])
    bias = DB * (polygamma(0, 4.0) - np.log(4.0) - polygamma(0, fewer) + np.log(fewer))
    constant = np.full_like(phi, falling.mean() + bias)
    figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3.2), layout="constrained")
    # the incidence is distributed evenly, so that a law and its mirror image have the same pixels
    for law, n, colour, name, style in (
        (falling, 4.0, BLUE, "falling law, 4 looks", "-"),
        (falling[::-1], 4.0, GREEN, "its mirror image, 4 looks", ":"),
        (constant, fewer, ORANGE, f"constant, {fewer:.1f} looks", "--"),
    ):
        density = speckle(level[:, None], law[None, :], n).mean(axis=1)
        left.plot(level, density, style, color=colour, lw=2.4, label=name)
        right.plot(phi, law, style, color=colour, lw=2.4)
    right.plot(phi[12::25], falling[12::25], "o", color="black", label="mean of the measured\npixels of each bin")
    left.set(xlabel="pixels [dB]", yticks=[], title="Histogram: any of the three", ylim=(0, 0.21))
    right.set(xlabel="local incidence [deg]", ylabel="sigma0 [dB]", title="Bins of incidence: only one", ylim=(-13, -2))
    left.legend(frameon=False, loc="upper left")
    right.legend(frameon=False, loc="upper center")
    figure.savefig(HERE / "concept_histogram.png", dpi=150)


def box(axes: Axes, x: float, y: float, text: str, colour: str = GREY, width: float = 2.1) -> None:
    """Box with a text, centred."""
    axes.add_patch(FancyBboxPatch((x - width / 2, y - 0.42), width, 0.84, boxstyle="round,pad=0.02", ec=colour,
                                  fc="white", lw=1.6))  # fmt: skip
    axes.text(x, y, text, ha="center", va="center", fontsize=9.5)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Arrow between two places."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": GREY, "lw": 1.3})


def verdict() -> None:
    """From pixels to the three words of the verdict."""
    known = Uncertainty().known_db
    figure, axes = plt.subplots(figsize=(7, 4.4), layout="constrained")
    axes.set(xlim=(0, 7.1), ylim=(0, 5.2))
    axes.axis("off")
    box(axes, 1.1, 4.7, "fixed materials:\nmeasured - simulated")
    box(axes, 3.55, 4.7, "calibrated material:\nmeasured - simulated")
    box(axes, 6.0, 4.7, "search: runs of\nthe simulator")
    box(axes, 1.1, 3.2, "level, radiometry,\ntheir own errors", BLUE)
    box(axes, 3.55, 3.2, "law, error of its form,\nfields, cells, speckle", BLUE)
    for x in (1.1, 3.55):
        arrow(axes, (x, 4.24), (x, 3.68))
    arrow(axes, (2.2, 3.2), (2.46, 3.2))
    axes.text(2.35, 3.95, "one model of all", ha="center", fontsize=9.5, color=BLUE, style="italic")
    box(axes, 1.1, 1.75, "90 % band of sigma0\nat each angle")
    box(axes, 3.55, 1.75, "size of the form's error;\nbump that would show")
    box(axes, 6.0, 1.75, "would a better law\nstill be found?")
    arrow(axes, (2.9, 2.74), (1.9, 2.22))
    arrow(axes, (3.55, 2.74), (3.55, 2.22))
    arrow(axes, (6.0, 4.24), (6.0, 2.22))
    box(axes, 1.1, 0.5, f"determined where its half-\nwidth is at most {known:g} dB", GREEN)
    box(axes, 3.55, 0.5, "not refuted if it is not\nshown to exceed 1 dB", GREEN)
    box(axes, 6.0, 0.5, "finished\nif not", GREEN)
    for x in (1.1, 3.55, 6.0):
        arrow(axes, (x, 1.29), (x, 0.97))
    figure.savefig(HERE / "concept_verdict.png", dpi=150)


def radiometry() -> None:
    """Areas by which a pixel's cross-section is divided, and what follows on level ground and on a slope."""
    theta, slope = np.radians(40.0), np.radians(15.0)
    phi = theta - slope
    figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3.5), layout="constrained", width_ratios=(1.1, 1))
    sight, front = np.array([-np.sin(theta), np.cos(theta)]), np.array([np.cos(theta), np.sin(theta)])
    length = 1.5  # of the pixel in slant range
    near, flat = np.zeros(2), np.array([length / np.sin(theta), 0.0])
    far = np.array([np.cos(slope), np.sin(slope)]) * length / np.sin(phi)
    for foot, lowest in ((near, 0.0), (flat, -1.79)):  # both ends of the pixel: equal distance from the radar
        left.plot(*np.array([foot + lowest * front, foot + (4.4 + lowest / 2) * front]).T, ":", color=GREY, lw=1)
    left.add_patch(Polygon([near, far, [far[0], 0]], color="#e6dccb"))
    left.plot([-0.8, 4.2], [0, 0], color="black", lw=1)
    for start, end, colour, text, place in (
        (near, flat, BLUE, "sigma0_ref:\nlevel ground", (0.35, -0.5)),
        (near, far, GREEN, "the slope's\nown area", (4.22, 0.4)),
        (3.7 * front, 3.7 * front - sight * length, ORANGE, "beta0:\nslant range", (4.0, 2.3)),
        (flat, flat - front * length / np.tan(theta), GREY, "gamma0:\nacross the beam", (2.7, -0.95)),
    ):
        left.plot(*np.array([start, end]).T, color=colour, lw=3.5, solid_capstyle="butt")
        left.text(*place, text, color=colour, ha="center", va="center", fontsize=9.5)
    left.annotate("radar", 0.2 * sight, 2.0 * sight, ha="center", arrowprops={"arrowstyle": "<|-"}, fontsize=9.5)
    left.set(aspect="equal", xlim=(-1.5, 4.7), ylim=(-1.4, 2.9), title="Areas of one pixel")
    left.axis("off")
    names = ("beta0", "gamma0", "sigma0_ref", "gamma0_rtc", "sigma0_local")
    for k, (angle, colour, text) in enumerate(((theta, "#9db8c9", "level ground"), (phi, BLUE, "slope of 15 deg"))):
        ratio = np.array([1 / np.sin(angle), np.tan(theta) / np.sin(angle), np.sin(theta) / np.sin(angle),
                          1 / np.cos(angle), 1.0])  # fmt: skip
        places = np.arange(5) + 0.38 * (0.5 - k)
        values = DB * np.log(ratio)
        right.barh(places, values, 0.36, color=colour, label=text)
        for place, value in zip(places, values, strict=True):
            right.text(value + 0.08, place, f"{value:.1f}", va="center", fontsize=9)
    right.set(yticks=range(5), yticklabels=names, xlabel="[dB]", xlim=(0, 4.6), title="Pixel minus sigma0(phi)")
    right.invert_yaxis()
    right.legend(frameon=False, loc="lower right")
    figure.savefig(HERE / "concept_radiometry.png", dpi=150)


def levels() -> None:
    """What the three normalisations do with a measured image that is brighter and more spread."""
    figure, rows = plt.subplots(1, 3, figsize=(7, 2.3), layout="constrained", sharey=True)
    x = np.linspace(-8.0, 8.0, 321)
    for axes, name, shift, spread, text in zip(
        rows, ("none", "offset", "image"), (2.0, 0.0, 0.0), (1.3, 1.3, 1.0),
        ("compared as they are", "one level removed,\nspread kept", "median and spread\nremoved"), strict=True,
    ):  # fmt: skip
        for middle, width, style, label in ((0.0, 1.0, "-", "simulated"), (shift, spread, "--", "measured")):
            density = np.exp(-0.5 * ((x - middle) / width) ** 2) / width
            axes.plot(x, density, style, color=BLUE if style == "-" else ORANGE, lw=2.4, label=label)
        axes.set(title=name, yticks=[], xticks=[], ylim=(0, 1.5), xlabel=text)
    rows[0].legend(frameon=False, loc="upper left", fontsize=9)
    figure.savefig(HERE / "concept_levels.png", dpi=150)


def cost() -> None:
    """Time of a calibration over the time of one run; parts of the default case."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3.4), layout="constrained", width_ratios=(1, 1.1))
    parts = (("scene, geometry,\nreference run", 21), ("registration,\ntwice; target", 32), ("search: three runs", 14),
             ("final runs", 3), ("posterior, report", 21))  # fmt: skip
    seconds = np.array([length for _, length in parts])
    left.barh(range(5), seconds, left=np.cumsum(seconds) - seconds, color=[GREY, GREY, BLUE, BLUE, GREY])
    left.set(
        yticks=range(5), yticklabels=[name for name, _ in parts], xlabel="seconds", title="Default case, two cores"
    )
    left.invert_yaxis()
    run = np.logspace(0, 4, 50)
    for n, colour, name in ((970, ORANGE, "970 runs: the published example"), (20, GREY, "20: law unknown to radcal"),
                            (6, BLUE, "6: default case")):  # fmt: skip
        right.loglog(run, (n * run + 90.0) / 3600.0, color=colour, lw=2, label=name)
    right.axvline(420, color="black", lw=0.8, ls=":")
    right.text(460, 0.015, "7 min a run", fontsize=9)
    right.set(xlabel="seconds a run", ylabel="hours in all", title="Any simulator", ylim=(0.01, 1e5))
    right.legend(frameon=False, loc="upper left", fontsize=9)
    figure.savefig(HERE / "concept_cost.png", dpi=150)


for draw in (histogram, verdict, radiometry, levels, cost):
    draw()

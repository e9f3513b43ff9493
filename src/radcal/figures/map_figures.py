"""Maps of the measured and simulated images, of the registration and of the residual."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.figures.drawing import Array, Drawn, add_fills, colours_of, label, new_canvas, of_ids
from radcal.results.archive import Archive

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

Aspect = Literal["equal", "auto"]

_BOXCAR = 9  # side of the blocks over which the residual is averaged [pixels]
_BEYOND = 0.1  # share of a simulated image beyond the measured image's gray scale, and
_MOVED = 0.25  # difference of the medians in parts of this scale, above which the simulated image has its own scale
_ARROW = 30.0  # length of an arrow [points]
_LEAST_SHARE = 1e-3  # of pixels with a value, below which a mean has none
_MISSING = "#F6E9D8"  # pixels without a value
_MARGIN = 0.08  # ground around the calibrated materials in the compared images, as a share of their larger extent
_COMPARED = 1024  # largest number of pixels per side of the compared images
_LARGEST = 1600  # largest number of pixels per side of an image in a figure; larger images are averaged


def _averaged(image_db: NDArray[Any], average: Callable[[Array], Array]) -> Array:
    """Image [dB] averaged in power over the pixels with a value; NaN where there are none."""
    valid = np.isfinite(image_db)
    power = np.where(valid, 10.0 ** (np.where(valid, image_db, 0.0).astype(np.float64) / 10.0), 0.0)
    share, total = average(valid.astype(np.float64)), average(power)
    known = (share > _LEAST_SHARE) & (total > 0.0)
    return np.asarray(10.0 * np.log10(np.divide(total, share, out=np.full(share.shape, np.nan), where=known)))


def _factor(shape: tuple[int, ...], largest: int | None = None) -> int:
    k = -(-max(shape) // (largest or _LARGEST))
    return k if min(shape) >= k else 1


def _shown(image_db: NDArray[Any], largest: int | None = None) -> NDArray[Any]:
    """Image for a figure, averaged over blocks of pixels if it is large; an incomplete block at the end is dropped."""
    k = _factor(image_db.shape, largest)
    rows, columns = (n // k for n in image_db.shape)

    def blocks(values: Array) -> Array:
        return np.asarray(values[: rows * k, : columns * k].reshape(rows, k, columns, k).mean(axis=(1, 3)))

    return image_db if k == 1 else _averaged(image_db, blocks)


def panels_for(shape: tuple[int, ...], n: int, below: float = 0.0) -> tuple[Canvas, list[Axes], bool, Aspect]:
    """Figure with n empty panels: stacked for wide images, else side by side; very long images are stretched."""
    ratio = shape[0] / shape[1]
    aspect: Aspect = "equal" if 0.2 <= ratio <= 2.5 else "auto"
    ratio = float(np.clip(ratio, 0.2, 2.5))
    width = 9.5
    if ratio < 0.6:
        canvas = new_canvas(width, n * ((width - 1.9) * ratio + 0.55) + 0.45 + below, "compressed")
        axes = canvas.subplots(n, 1, sharex=True, sharey=True, squeeze=False)
    else:
        canvas = new_canvas(width, (width - 1.9) / n * ratio + 0.85 + below, "compressed")
        axes = canvas.subplots(1, n, sharex=True, sharey=True, squeeze=False)
    for panel in axes.ravel():
        panel.grid(False)
        panel.set_facecolor(_MISSING)
        for spine in panel.spines.values():
            spine.set_visible(True)
    return canvas, list(axes.ravel()), ratio < 0.6, aspect


def axis_labels(panels: Sequence[Axes], stacked: bool) -> None:
    """Label the axes of image panels with azimuth and slant range [pixel]."""
    for panel in panels if not stacked else panels[-1:]:
        panel.set_xlabel("azimuth [pixel]")
    for panel in panels if stacked else panels[:1]:
        panel.set_ylabel("slant range [pixel]")
    for panel in panels:
        panel.locator_params(axis="x", nbins=4, integer=True)
        panel.locator_params(axis="y", nbins=5, integer=True)


# rows of an image lie along slant range, columns along azimuth
_OF_IMAGE: Mapping[str, tuple[float, float]] = {"flight": (1.0, 0.0), "look": (0.0, -1.0)}


def add_arrows(
    panel: Axes, place: tuple[float, float] = (0.06, 0.95), arrows: Mapping[str, tuple[float, float]] = _OF_IMAGE
) -> None:
    """Draw arrows of directions from one point of a map.

    Parameters
    ----------
    panel : Axes
        The map.
    place : tuple of float
        Common start of the arrows, in shares of the panel's width and height.
    arrows : mapping
        Direction to the right and upwards by label; by default those of an image.
    """
    from matplotlib.patheffects import withStroke

    for text, (right, up) in arrows.items():
        panel.annotate(
            text, place, (_ARROW * right, _ARROW * up), xycoords="axes fraction", textcoords="offset points",
            ha="center", va="center", fontsize=8.5, fontweight="bold", color="black",
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "alpha": 0.85, "linewidth": 0.0},
            arrowprops={
                "arrowstyle": "<|-", "color": "black", "linewidth": 2.0, "shrinkA": 0.0, "shrinkB": 0.0,
                "path_effects": [withStroke(linewidth=4.0, foreground="white")],
            },
        )  # fmt: skip


def image_extent(shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    """Extent of an image on axes where pixel centres are whole numbers."""
    return (-0.5, shape[1] - 0.5, shape[0] - 0.5, -0.5)


def images(case: Archive) -> Drawn:
    """Figure of the measured image and of the simulated images before (start) and after calibration."""
    each = _compared(case)
    first, own = case.measured_db, any(one.own_scale for one in each)
    canvas, panels, stacked, aspect = panels_for(first.shape, len(each))
    extent = image_extent(first.shape)
    for panel, one in zip(panels, each, strict=True):
        ends: dict[str, Any] = {"vmin": one.low_db, "vmax": one.high_db}
        shown = panel.imshow(_shown(one.image_db), cmap="gray", aspect=aspect, extent=extent, **ends)
        panel.set_title(f"start, own scale:\n{one.low_db:.0f} to {one.high_db:.0f} dB" if one.own_scale else one.title)
        if not one.own_scale:
            of_bar = shown
    add_arrows(panels[0])
    canvas.colorbar(of_bar, ax=panels, extend="both", fraction=0.05, pad=0.02, aspect=30, label="backscatter [dB]")
    axis_labels(panels, stacked)
    which = "Measured and calibrated image have" if own else "The three images have"
    caption = (
        f"{which} one gray scale, from the 1 to the 99.5 % quantile of the measured pixels; near range is on top. "
    )
    if own:
        caption += "The start would be nearly black or white there, and has a scale of its own, given in its title. "
    caption += (
        "The calibrated image is simulated with the laws of the search and has speckle of its own: compare levels and "
        "textures, not single pixels."
    )
    if missing := int(np.count_nonzero(~np.isfinite(first))):
        caption += f" {missing:,} measured pixels have no value (cream)."
    if (k := _factor(first.shape)) > 1:
        caption += f" Shown as means over {k} x {k} pixels."
    scales = "the start in a gray scale of its own" if own else "in the same gray scale"
    return canvas, caption, f"Measured, starting and calibrated radar image side by side, {scales}."


@dataclass(frozen=True)
class Shot:
    """Measured, starting or calibrated image with its gray scale.

    Attributes
    ----------
    title : str
        ``measured``, ``start`` or ``calibrated``.
    image_db : ndarray, shape (rows, columns)
        The image [dB]; rows along slant range, near range on top.
    low_db, high_db : float
        Ends of the gray scale [dB].
    own_scale : bool
        Whether the scale is not that of the measured image.
    """

    title: str
    image_db: NDArray[Any]
    low_db: float
    high_db: float
    own_scale: bool

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """Red, green and blue of the image, averaged to at most 1,024 pixels per side, shape (rows, columns, 3)."""
        values = _shown(self.image_db, _COMPARED)
        gray = np.nan_to_num(255.0 * np.clip((values - self.low_db) / (self.high_db - self.low_db), 0.0, 1.0))
        missing = [int(_MISSING[k : k + 2], 16) for k in (1, 3, 5)]
        return np.round(np.where(np.isfinite(values)[..., None], gray[..., None], missing)).astype(np.uint8)


def _compared(case: Archive, where: tuple[slice, slice] = (slice(None), slice(None))) -> list[Shot]:
    """Measured, starting and calibrated image in the gray scale of the measured one.

    A start that would be nearly black or white there has a scale of its own. Images that are not archived are left out.
    """
    kept, found = case.images, []
    each = {"measured": case.measured_db, "start": kept.reference_db, "calibrated": kept.calibrated_db}
    cut = {title: image[where] for title, image in each.items() if image is not None}
    for title, image in cut.items():
        own = title == "start" and _unreadable(image, cut["measured"])
        found.append(Shot(title, image, *gray_scale(image if own else cut["measured"]), own))
    return found


def shots(case: Archive) -> list[Shot]:
    """The images that the page shows at the same place: the ground of the calibrated materials."""
    return _compared(case, _around_calibrated(case))


def _around_calibrated(case: Archive) -> tuple[slice, slice]:
    """Rows and columns of the image around the pixels of the calibrated materials; all without a map of materials."""
    material = case.images.material
    ids = [case.names.index(name) + 1 for name in case.materials]
    inside = np.ones(case.measured_db.shape, bool) if material is None else np.isin(material, ids)
    if not inside.any():
        return slice(None), slice(None)
    ends = [
        (int(there[0]), int(there[-1]) + 1) for there in map(np.flatnonzero, (inside.any(axis=1), inside.any(axis=0)))
    ]
    margin = round(_MARGIN * max(last - first for first, last in ends))
    rows, columns = (slice(max(0, first - margin), last + margin) for first, last in ends)
    return rows, columns


def gray_scale(image_db: NDArray[Any]) -> tuple[float, float]:
    """Ends of the gray scale of an image: its 1 % and 99.5 % quantile [dB], at least 1 dB apart."""
    finite = image_db[np.isfinite(image_db)]
    low, high = (float(v) for v in np.percentile(finite, [1.0, 99.5])) if finite.size else (-30.0, 0.0)
    return low, max(high, low + 1.0)


def _unreadable(image_db: NDArray[Any], other_db: NDArray[Any]) -> bool:
    """Whether an image would be nearly black or white in the gray scale of another image."""
    values, others = (one[np.isfinite(one)] for one in (image_db, other_db))
    if not values.size or not others.size:
        return False
    low, high = gray_scale(other_db)
    beyond = float(((values < low) | (values > high)).mean())
    return beyond > _BEYOND or abs(float(np.median(values) - np.median(others))) > _MOVED * (high - low)


def registration(case: Archive) -> Drawn | None:
    """Figure of the measured image before and after registration, and of the displacement."""
    registered, simulated = case.registered, case.images.reference_db
    if not registered.applied or simulated is None:
        return None
    field = registered.displacement_px.astype(np.float64)
    canvas, panels, stacked, aspect = panels_for(simulated.shape, 3)
    extent, k = image_extent(simulated.shape), _factor(simulated.shape)
    # chequerboard of both images, in which roads and borders must continue from square to square
    rows, columns = np.indices(simulated.shape) // (max(simulated.shape) // 9)
    squares = (rows + columns) % 2 == 0
    levelled = _levelled(simulated)
    for panel, title, image in zip(
        panels, ("as measured", "registered"), (registered.unregistered_db, case.measured_db), strict=False
    ):
        both = np.where(squares, levelled, _levelled(image))
        panel.imshow(both[::k, ::k], cmap="gray", vmin=-2.0, vmax=2.0, aspect=aspect, extent=extent)
        panel.set_title(title)
    add_arrows(panels[0])
    length = np.hypot(*field)
    largest = max(float(length.max()), 1e-6)
    shown = panels[2].imshow(length[::k, ::k], cmap="viridis", vmin=0.0, aspect=aspect, extent=extent)
    step = max(simulated.shape) // 14
    y, x = np.mgrid[step // 2 : simulated.shape[0] : step, step // 2 : simulated.shape[1] : step]
    arrows = {"color": "white", "angles": "xy", "scale_units": "xy", "scale": largest / step, "width": 0.005}
    panels[2].quiver(x, y, field[1][y, x], field[0][y, x], **arrows)
    panels[2].set_title("displacement")
    canvas.colorbar(shown, ax=panels, fraction=0.05, pad=0.02, aspect=30, label="displacement [pixel]")
    axis_labels(panels, stacked)
    caption = (
        "“As measured” and “registered” are chequerboards of squares of the reference run and of the measured image, "
        "before and after the registration: borders of the ground must continue from square to square. Each image is "
        "averaged over 5 x 5 pixels and has a gray scale of its own. “Displacement” points from each pixel to its "
        f"place in the image as measured; the longest arrow stands for {largest:.1f} pixels."
    )
    if (true_px := registered.measurement.misregistration_px) is not None:
        error = np.hypot(*(field - true_px)).mean()
        caption += f" The true displacement of this synthetic image is known: the mean error is {error:.2f} pixels."
    alt = "Chequerboards of simulated and measured image before and after registration, and the displacement field."
    return canvas, caption, alt


def _levelled(image_db: NDArray[Any]) -> Array:
    """Image averaged over 5 x 5 pixels, shifted to zero median, and divided by half the width of the middle 68 %."""
    smooth = _averaged(image_db, lambda values: scipy.ndimage.uniform_filter(values, 5))
    low, middle, high = np.nanpercentile(smooth, [16.0, 50.0, 84.0])
    return np.asarray((smooth - middle) / max(0.5 * float(high - low), 1e-6))


def residual(case: Archive) -> Drawn | None:
    """Figure of the residual (calibrated minus measured image) beside the materials."""
    images = case.images
    if images.calibrated_db is None or images.material is None:
        return None
    difference = _smoothed(images.calibrated_db - case.measured_db, images.incidence_deg)
    material = images.material.astype(np.int64)
    present = [int(number) for number in np.unique(material) if 0 < number <= len(case.names)]
    labels = [
        f"{number}  {label(case.names[number - 1], 34)}" + (" *" if case.names[number - 1] in case.materials else "")
        for number in present
    ]
    columns = max(1, min(4, int(105 / (max(map(len, labels), default=1) + 9))))
    rows = -(-(len(labels) + 1) // columns)
    canvas, panels, stacked, aspect = panels_for(difference.shape, 2, below=0.215 * rows)
    (left, right), (cmap, norm) = panels, of_ids(case)
    k = _factor(difference.shape)
    finite = difference[np.isfinite(difference)]
    limit = float(np.clip(np.ceil(np.percentile(np.abs(finite), 98.0)), 1.0, 40.0)) if finite.size else 1.0
    shown = left.imshow(
        difference[k // 2 :: k, k // 2 :: k], cmap="RdBu_r", vmin=-limit, vmax=limit, aspect=aspect,
        extent=image_extent(difference.shape),
    )  # fmt: skip
    left.set_title("calibrated minus measured")
    add_arrows(left)
    canvas.colorbar(shown, ax=left, extend="both", fraction=0.05, pad=0.02, aspect=30, label="difference [dB]")
    right.imshow(
        material[k // 2 :: k, k // 2 :: k], cmap=cmap, norm=norm, aspect=aspect,
        extent=image_extent(material.shape), interpolation="nearest",
    )  # fmt: skip
    right.set_title("materials")
    for number in present:
        row, column = _middle(material, number)
        right.text(
            column, row, str(number), ha="center", va="center", fontsize=10.0, fontweight="bold",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "black", "linewidth": 0.6},
        )  # fmt: skip
    if not stacked:
        canvas.set_layout_engine("compressed", wspace=0.05, h_pad=0.08)
    fills = [*(colours_of(case)[number - 1] for number in present), "#FFFFFF"]
    add_fills(canvas, fills, [*labels, "mixed or unseen"], columns)
    axis_labels(panels, stacked)
    # Oliver and Quegan 2004: variance of log intensity is trigamma(looks); neighbours are correlated, so that this is a
    # lower bound
    looks = case.configured.radar.looks
    speckle = 10.0 / np.log(10.0) * np.sqrt(2.0 * float(scipy.special.polygamma(1, looks))) / _BOXCAR
    caption = (
        f"First map: calibrated minus measured image, mean of the dB values over {_BOXCAR} x {_BOXCAR} pixels. Red: "
        f"the calibrated image is too bright, blue: too dark. Speckle alone, of {looks:g} looks in both images, gives "
        f"this mean a standard deviation of {speckle:.2g} dB, and more where neighbouring pixels are correlated. "
        "Cream: pixels without ground of the scene, or without a measured value. Second map: the materials of the "
        "scene; those marked * were calibrated, the others kept their laws."
    )
    return canvas, caption, "Map of the difference between calibrated and measured image in dB, and the material map."


def _smoothed(pixels: NDArray[Any], incidence_deg: NDArray[Any] | None) -> NDArray[Any]:
    """Moving average of a difference [dB]; NaN where too few pixels of the window have a value."""
    # where no material is visible the simulation holds only noise and was not compared
    valid = np.isfinite(pixels) & np.isfinite(pixels if incidence_deg is None else incidence_deg)
    share = scipy.ndimage.uniform_filter(valid.astype(np.float32), _BOXCAR, mode="constant")
    total = scipy.ndimage.uniform_filter(np.where(valid, pixels, 0.0), _BOXCAR, mode="constant")
    enough = valid & (share > 0.25)
    return np.where(enough, total / np.where(enough, share, 1.0), np.nan)


def _middle(material: NDArray[Any], number: int) -> tuple[int, int]:
    """Row and column of the point of a material that is farthest from its border; objects in it are no border."""
    k = max(1, max(material.shape) // 400)
    if not (material[k // 2 :: k, k // 2 :: k] == number).any():
        k = 1
    coarse = material[k // 2 :: k, k // 2 :: k]
    inside = coarse == number
    inside |= (coarse == 0) & scipy.ndimage.binary_closing(inside, np.ones((3, 3)))
    depth = scipy.ndimage.distance_transform_cdt(np.pad(inside, 1), metric="taxicab")[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
    return int(row) * k + k // 2, int(column) * k + k // 2

"""Figures of the scene and of the local incidence angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.figures.drawing import SIGMA0, Drawn, add_fills, colours_of, label, new_canvas, of_ids
from radcal.figures.map_figures import add_arrows, axis_labels, image_extent, panels_for
from radcal.results.archive import Archive
from radcal.scene.crs import crs_from

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HATCHED = 300  # number of places per side at which the hatching of a map is computed
_LEAST_SCALE = 0.01  # smallest range of a colour scale [deg or dB]
_FLAT_DEG = 1.0  # ground whose slopes are below this angle at 99 % of the cells has no relief to show


def scene(case: Archive) -> Drawn | None:
    """Figure of the scene: materials, elevation and, unless the ground is flat, shaded relief, or visible imagery."""
    from matplotlib import colormaps
    from matplotlib.colors import LightSource, ListedColormap

    view = case.scene
    if view.elevation_m is None:
        return None
    elevation = view.elevation_m.astype(np.float64)
    cell_m = view.cell_m * view.step
    objects_m = view.objects_m
    steepest_deg = 0.0
    if min(elevation.shape) >= 2:
        steepest_deg = float(np.degrees(np.arctan(np.percentile(np.hypot(*np.gradient(elevation, cell_m)), 99.0))))
    flat = steepest_deg < _FLAT_DEG
    # the grid of a scene points north or, with a heading, along the track
    heading, west_m, south_m = case.configured.radar.heading_deg, view.west_m, view.south_m
    across, along, lit = "east [km]", "north [km]", "the north-west"
    if heading:
        across, along = "right of the track [km]", f"along the track, {heading:g} deg [km]"
        lit = "ahead on the left"
    ny, nx = elevation.shape
    sides = west_m / 1e3, (west_m + nx * cell_m) / 1e3, south_m / 1e3, (south_m + ny * cell_m) / 1e3
    picture = None if view.imagery is None else view.imagery / 255.0
    seen = "shaded relief" if picture is None else "imagery" if flat else "shaded imagery"
    if not flat:
        sun = LightSource(azdeg=315.0, altdeg=40.0)
        shade = sun.hillshade(elevation, dx=cell_m, dy=cell_m)
        picture = shade if picture is None else sun.blend_overlay(picture, shade[..., None])
    count = 2 if picture is None else 3
    canvas, (cmap, norm) = new_canvas(4.0 * count, 4.6), of_ids(case)
    plans = canvas.subplots(1, count)
    if picture is not None:
        plans[2].imshow(picture, cmap="gray", origin="lower", extent=sides)
        plans[2].set_title(seen)
    plans[0].imshow(view.material, cmap=cmap, norm=norm, origin="lower", extent=sides, interpolation="nearest")
    if objects_m is not None:
        # drawn as single pixels, so that their number does not matter
        plans[0].plot(*(objects_m + np.array([west_m, south_m])).T / 1000.0, ",", color="black", rasterized=True)
        plans[0].set(xlim=sides[:2], ylim=sides[2:])
    plans[0].set_title("materials" if objects_m is None else "materials and objects (black)")
    # without the blue lower end, which looks like a lake
    ground = ListedColormap(colormaps["terrain"](np.linspace(0.25, 1.0, 256)))
    shown = plans[1].imshow(elevation, cmap=ground, origin="lower", extent=sides)
    plans[1].set_title("elevation")
    canvas.colorbar(shown, ax=plans[1], fraction=0.046, pad=0.03, label="elevation [m]")
    for panel in plans:
        panel.grid(False)
        panel.set(xlabel=across, ylabel=along)
        panel.locator_params(nbins=5)
        panel.ticklabel_format(useOffset=False)
    look = 1.0 if case.configured.radar.look_side == "right" else -1.0
    add_arrows(plans[0], (0.06, 0.81), {"N": (-np.sin(np.radians(heading)), np.cos(np.radians(heading)))})
    add_arrows(plans[0], (0.5 - 0.44 * look, 0.06), {"flight": (0.0, 1.0), "look": (look, 0.0)})
    places = [int(k) - 1 for k in np.unique(view.material) if 0 < k <= len(case.names)]
    add_fills(canvas, [colours_of(case)[k] for k in places], [label(case.names[k], 30) for k in places], 6)
    # a low relief needs a digit after the point
    digits = 1 if np.ptp(elevation) < 10.0 else 0
    caption = (
        f"The scene: {nx * cell_m / 1000.0:.3g} by {ny * cell_m / 1000.0:.3g} km, heights from "
        f"{elevation.min():.{digits}f} to {elevation.max():.{digits}f} m."
    )
    if view.crs is not None:
        caption += f" Coordinates are those of {crs_from(view.crs).name}."
    if view.imagery is not None:
        caption += " Imagery: visible light, of no effect on the results."
    if not flat:
        caption += f" The light of the {seen} comes from {lit}."
    if objects_m is not None:
        caption += " Objects are dots, whatever their size."
    return canvas, caption, "Material map, elevation map" + f", {seen}" * (count == 3) + "."


def incidence(case: Archive) -> Drawn | None:
    """Figure of two maps: local incidence angle, and sigma0 that the calibrated laws give at this angle."""
    angle, material = case.images.incidence_deg, case.images.material
    if angle is None or material is None:
        return None
    if not np.isfinite(angle).any():
        return None
    expected, laws = np.full(angle.shape, np.nan), case.configured.laws
    for k, name in enumerate(case.names, start=1):
        law = laws.get(name)
        if law is not None and law.has_curve:  # the curve of an external law is not known
            inside = material == k
            expected[inside] = law(np.radians(angle[inside].astype(np.float64)), case.laws[name])
    # a label along the bar would stand beside the right panel like the label of its axis
    maps: list[tuple[NDArray[Any], str, str]] = [(angle, "viridis", "local incidence [deg]")]
    if np.isfinite(expected).any():
        maps.append((expected, "gray", f"{SIGMA0}, calibrated laws"))
    canvas, panels, stacked, aspect = panels_for(angle.shape, len(maps))
    where, k = image_extent(angle.shape), max(1, max(angle.shape) // 1600)
    add_arrows(panels[0])
    for panel, (values, colours, title) in zip(panels, maps, strict=True):
        low, high = _scale(values)
        drawn = panel.imshow(values[::k, ::k], cmap=colours, vmin=low, vmax=high, aspect=aspect, extent=where)
        panel.set_title(title)
        canvas.colorbar(drawn, ax=panel, extend="both", fraction=0.05, pad=0.02)
    axis_labels(panels, stacked)
    hatched = ""
    if _hatch_determined(panels[0], case, angle, material):
        hatched = " Hatched: ground whose incidence is inside of the interval in which sigma0 of its material is "
        hatched += "determined."
    if len(maps) == 1:
        return canvas, f"Mean local incidence of the ground in each pixel.{hatched}", "Map of the local incidence."
    caption = (
        "First map: mean local incidence of the ground in each pixel. Second map: sigma0 that the calibrated or fixed "
        f"law of the pixel's material gives at this incidence, without speckle, noise or point spread.{hatched}"
    )
    return canvas, caption, "Maps of the local incidence angle and of the backscatter that the laws expect there."


def _hatch_determined(panel: Axes, case: Archive, angle: NDArray[Any], material: NDArray[Any]) -> bool:
    """Hatch the ground whose incidence lies where its law is determined; whether there is any."""
    inside = np.zeros(angle.shape, dtype=np.float32)
    for name, result in case.materials.items():
        if (known := result.posterior.known_between_deg) is not None:
            inside[(material == case.names.index(name) + 1) & (angle >= known[0]) & (angle <= known[1])] = 1.0
    if not inside.any():
        return False
    k = max(1, max(angle.shape) // _HATCHED)
    # of the pixels with a material: objects and their shadows, which have none, are no borders
    ground = (material > 0).astype(np.float32)
    determined, ground = (
        scipy.ndimage.uniform_filter(one, 2 * k + 1)[k // 2 :: k, k // 2 :: k] for one in (inside, ground)
    )
    share = determined / np.maximum(ground, 1e-3)
    rows, columns = (np.arange(n)[k // 2 :: k] for n in angle.shape)
    areas = panel.contourf(columns, rows, share, levels=[0.5, 2.0], colors="none", hatches=["////"])
    areas.set(edgecolor="white", linewidth=0.8)
    return True


def _scale(values: NDArray[Any]) -> tuple[float, float]:
    """Ends of a colour scale: 1 % and 99 % quantile of the values, widened to 0.01 about their middle if closer."""
    low, high = (float(v) for v in np.nanpercentile(values, [1.0, 99.0]))
    middle = 0.5 * (low + high)
    return (low, high) if high - low >= _LEAST_SCALE else (middle - 0.5 * _LEAST_SCALE, middle + 0.5 * _LEAST_SCALE)

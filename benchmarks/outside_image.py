"""Image former that shares no code with the simulator: the measured images of ``benchmarks/twins.py``.

Ground of facets of 1 m, of which each one scatters with a random amplitude of its own. The echoes of all facets are
added coherently at their slant range and azimuth, spread by the impulse response of the system, and averaged in power
over the looks. Geometry, radiometry, laws, impulse response, speckle and noise are written from their sources; nothing
is imported from ``radcal.radar`` or ``radcal.simulators``. ``docs/simulator.md`` describes the acquisition that both
have in common. The axes of the ground are x (east, ground range) and y (north, azimuth) from the south-west corner of
the scene of the case [m]; axis 0 of an array of cells or facets is y.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.optimize import brentq
from scipy.special import ndtr, polygamma
from scipy.stats import gamma

from radcal.config import Radar

Doubles = NDArray[np.float64]
Curve = Callable[[Doubles], Doubles]  # sigma0 [dB] at the local incidence [rad]

FACETS = 5  # facets along a side of a cell
FINE = 6  # places within a pixel, along each axis, at which a facet may lie
REACH = 8  # half of the impulse response's extent [pixels]
NBAR, SIDELOBE_DB = 4, 35.0


@dataclass(frozen=True)
class Ground:
    """Ground that is imaged.

    Attributes
    ----------
    elevation_m : ndarray, shape (ny, nx)
        Elevation of the cell centres [m].
    material : ndarray of int, shape (ny, nx)
        Material id of each cell; ``names[k - 1]`` is the name of id k, and id 0 does not scatter.
    names : tuple of str
        Names of the materials.
    cell_m : float
        Side of a cell [m].
    corner_m : (float, float)
        y and x of the outer corner of cell (0, 0) [m].
    """

    elevation_m: Doubles
    material: NDArray[np.int64]
    names: tuple[str, ...]
    cell_m: float
    corner_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Flight:
    """Track, parallel to y, and grid of the image.

    Attributes
    ----------
    track_x_m, track_z_m : float
        Place of the track across its own direction and its elevation [m].
    height_m : float
        Height of the track above the level ground of ``sigma0_ref`` [m].
    near_m : float
        Slant range of the centres of row 0 [m].
    shape : (int, int)
        Rows and columns; column 0 begins at y = 0.
    """

    track_x_m: float
    track_z_m: float
    height_m: float
    near_m: float
    shape: tuple[int, int]


@dataclass(frozen=True)
class Changes:
    """What the image has and the case does not say; by default nothing.

    Attributes
    ----------
    radiometry : str or None
        Radiometry of the image: sigma0_ref, sigma0_local or beta0; None for that of the pass.
    level_db, noise_db : float
        Errors of the image's level and of the noise level [dB].
    coarser : float
        Ratio of the resolutions to those of the pass.
    warp_px : float
        Displacement of the image along each axis, rms of a smooth field [pixels].
    micro_deg, micro_m : float
        Relief that the elevation model lacks: rms slope along one axis [deg] and correlation length [m].
    texture_db, texture_m : float
        Gamma texture: standard deviation [dB] and correlation length [m].
    wrong_labels : float
        Share of the cells that have another material, half of them on borders and half in squares of 4 x 4 cells.
    fields_db : mapping
        Standard deviation of the levels of a material's fields (connected areas) [dB].
    shifts_db : mapping
        Level common to all fields of a material [dB].
    """

    radiometry: str | None = None
    level_db: float = 0.0
    noise_db: float = 0.0
    coarser: float = 1.0
    warp_px: float = 0.0
    micro_deg: float = 0.0
    micro_m: float = 4.0
    texture_db: float = 0.0
    texture_m: float = 10.0
    wrong_labels: float = 0.0
    fields_db: Mapping[str, float] = field(default_factory=dict)
    shifts_db: Mapping[str, float] = field(default_factory=dict)


def mangia(x: tuple[float, ...], phi: Doubles) -> Doubles:
    """Sigma0 [dB] by equation 1 of the paper (``docs/laws.md``): X1 + X2 cos(phi) + X3 exp(-X4 phi^2)."""
    return np.asarray(x[0] + x[1] * np.cos(phi) + x[2] * np.exp(-x[3] * phi**2))


def oh(permittivity: complex, rms_cm: float, frequency_ghz: float, phi: Doubles) -> Doubles:
    """Sigma0 [dB] of bare soil at HH, equations 1 to 6 of Oh, Sarabandi and Ulaby (IEEE TGRS 30, 1992, 370-381)."""
    ks = 2.0 * np.pi * frequency_ghz / 29.9792458 * rms_cm
    cos = np.maximum(np.cos(phi), 1e-6)
    inside = np.sqrt(permittivity - np.sin(phi) ** 2)
    horizontal = np.abs((cos - inside) / (cos + inside)) ** 2
    vertical = np.abs((permittivity * cos - inside) / (permittivity * cos + inside)) ** 2
    nadir = np.abs((1.0 - np.sqrt(permittivity)) / (1.0 + np.sqrt(permittivity))) ** 2
    root_p = 1.0 - (2.0 * phi / np.pi) ** (1.0 / (3.0 * nadir)) * np.exp(-ks)
    vv = 0.7 * (1.0 - np.exp(-0.65 * ks**1.8)) * cos**3 / root_p * (vertical + horizontal)
    return np.asarray(10.0 * np.log10(root_p**2 * vv))


@cache
def taylor() -> tuple[tuple[float, ...], float, float]:
    """Taylor weighting of a band of unit width: coefficients F_m, -3 dB width and energy of its impulse response.

    Coefficients: Carrara, Goodman and Majewski, Spotlight Synthetic Aperture Radar (1995), appendix D.
    """
    a2 = (np.arccosh(10.0 ** (SIDELOBE_DB / 20.0)) / np.pi) ** 2
    widened = NBAR**2 / (a2 + (NBAR - 0.5) ** 2)
    i = np.arange(1, NBAR)
    found = []
    for m in i:
        above = np.prod(1.0 - m**2 / widened / (a2 + (i - 0.5) ** 2))
        found.append(float((-1.0) ** (m + 1) / 2.0 * above / np.prod(1.0 - (m / i[i != m]) ** 2)))
    f = tuple(found)
    half = brentq(lambda t: _pulse(np.array(t), f) / _pulse(np.array(0.0), f) - np.sqrt(0.5), 0.1, 1.5)
    return f, 2.0 * float(half), 1.0 + 2.0 * sum(x**2 for x in f)  # energy by Parseval's theorem


def _pulse(t: Doubles, f: tuple[float, ...]) -> Doubles:
    """Fourier transform of 1 + 2 sum of F_m cos(2 pi m u), |u| < 1/2."""
    return np.asarray(np.sinc(t) + sum(c * (np.sinc(t - m) + np.sinc(t + m)) for m, c in enumerate(f, 1)))


def response(pixels: int, resolution_px: float) -> sparse.csr_array:
    """Impulse response of unit energy at each pixel of a line, from each fine place: (pixels, places)."""
    f, width, energy = taylor()
    stretch = resolution_px / width
    row, step = np.meshgrid(np.arange(pixels), np.arange(2 * REACH * FINE), indexing="ij")
    away = (step + 0.5) / FINE - REACH  # place less the pixel's centre [pixels]
    values = _pulse(away / stretch, f) / np.sqrt(stretch * energy)
    column = row * FINE + step
    return sparse.csr_array((values.ravel(), (row.ravel(), column.ravel())), shape=(pixels, _places(pixels)))


def _places(pixels: int) -> int:
    return (pixels - 1 + 2 * REACH) * FINE


def smooth(rng: np.random.Generator, shape: tuple[int, ...], sigma: float) -> Doubles:
    """Gaussian field of unit variance, whose autocorrelation is exp(-(d / 2 sigma)^2)."""
    beyond = int(4.0 * sigma) + 1  # the filter's reach
    wide = rng.standard_normal([n + 2 * beyond for n in shape])
    one = ndimage.gaussian_filter1d(np.eye(1, 2 * beyond + 1, beyond)[0], sigma)
    values = ndimage.gaussian_filter(wide, sigma)[beyond:-beyond, beyond:-beyond]
    return np.asarray(values / np.sum(one**2))


def relabelled(ground: Ground, share: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Materials of the cells, of which a share is wrong: those of a neighbour, and in squares those of other ground."""
    true, wrong = ground.material, ground.material.copy()
    present = np.unique(true[true > 0])
    side = np.roll(true, 1, axis=int(rng.integers(2)))
    border = np.flatnonzero((side != true) & (true > 0) & (side > 0))
    n = min(border.size, round(share / 2.0 * true.size))
    chosen = rng.choice(border, n, replace=False)
    wrong.ravel()[chosen] = side.ravel()[chosen]
    while np.count_nonzero(wrong != true) < share * true.size:
        y, x = (int(rng.integers(size - 3)) for size in true.shape)
        wrong[y : y + 4, x : x + 4] = rng.choice(present)
    return wrong


def facet_heights(ground: Ground) -> Doubles:
    """Elevation of the facets [m]: cubic splines, which may leave the range of the 3 x 3 cells around by 15 % of it."""
    at = [(np.arange(n * FACETS) + 0.5) / FACETS - 0.5 for n in ground.elevation_m.shape]
    y, x = np.meshgrid(*at, indexing="ij")
    z = ground.elevation_m
    low, high = (
        np.repeat(np.repeat(of(z, 3, mode="nearest"), FACETS, 0), FACETS, 1)
        for of in (ndimage.minimum_filter, ndimage.maximum_filter)
    )
    slack = 0.15 * (high - low)
    return np.clip(ndimage.map_coordinates(z, [y, x], order=3, mode="nearest"), low - slack, high + slack)


def echoes(
    ground: Ground,
    flight: Flight,
    radar: Radar,
    curves: Mapping[str, Curve],
    changes: Changes,
    rng: np.random.Generator,
) -> tuple[NDArray[np.int64], Doubles]:
    """Fine place in the image (flat index) and expected power, in pixels of the image, of each facet that is seen.

    The cross-section of a facet is sigma0(phi) times its area. The reference areas are those of Ulander (IEEE TGRS 34,
    1996, 1133-1141): of ``beta0`` the pixel in the slant plane, of ``sigma0_ref`` the pixel on level ground, and of
    ``sigma0_local`` the area of the ground of the elevation model that the pixel contains, which is the pixel in the
    slant plane over the cosine between the normals of ground and slant plane. A facet is hidden if ground nearer to the
    track is seen under a larger angle from nadir.
    """
    side = ground.cell_m / FACETS
    model = facet_heights(ground)
    labels = relabelled(ground, changes.wrong_labels, rng) if changes.wrong_labels else ground.material
    height = model
    if changes.micro_deg:
        micro = smooth(rng, model.shape, changes.micro_m / side / 2.0)
        height = model + micro * np.tan(np.radians(changes.micro_deg)) / np.std(np.gradient(micro, side, axis=1))
    y, x = (c + (np.arange(n) + 0.5) * side for c, n in zip(ground.corner_m, height.shape, strict=True))
    across = np.broadcast_to(x - flight.track_x_m, height.shape)
    down = flight.track_z_m - height
    slant = np.hypot(across, down)
    sin, cos = across / slant, down / slant  # of the angle from nadir, at the radar

    along_slope, across_slope = np.gradient(height, side)
    area = np.sqrt(1.0 + along_slope**2 + across_slope**2)  # per unit of the map
    phi_cos = (
        cos + across_slope * sin
    ) / area  # the normal is (-slope x, -slope y, 1), the radar lies at (-sin, 0, cos)
    angle = np.arctan2(across, down)
    hidden = angle < np.maximum.accumulate(angle, axis=1)
    seen = (phi_cos > 0.0) & ~hidden

    level = np.zeros(height.shape)
    material = np.repeat(np.repeat(labels, FACETS, 0), FACETS, 1)
    for number, name in enumerate(ground.names, 1):
        here = material == number
        if not here.any():
            continue
        level[here] = curves[name](np.arccos(np.clip(phi_cos[here], 0.0, 1.0))) + changes.shifts_db.get(name, 0.0)
        if spread := changes.fields_db.get(name, 0.0):
            fields, n = ndimage.label(labels == number)
            effect = np.append(0.0, rng.normal(0.0, spread, n))[fields]
            level[here] += np.repeat(np.repeat(effect, FACETS, 0), FACETS, 1)[here]
    power = 10.0 ** (level / 10.0) * area * side**2 / (radar.range_spacing_m * radar.azimuth_spacing_m)  # beta0
    if changes.texture_db:
        power *= texture(
            changes.texture_db, smooth(rng, (power.shape[0], power.shape[1]), changes.texture_m / side / 2.0)
        )
    radiometry = changes.radiometry or radar.radiometry
    if radiometry == "sigma0_ref":
        power *= np.sqrt(1.0 - (flight.height_m / slant) ** 2)
    elif radiometry == "sigma0_local":
        b, a = np.gradient(model, side)
        power *= np.abs(sin - a * cos) / np.sqrt(1.0 + a**2 + b**2)
    elif radiometry != "beta0":
        raise ValueError(f"radiometry {radiometry!r}: expected sigma0_ref, sigma0_local or beta0")

    # a facet's scatterers lie anywhere in it
    u, v = rng.uniform(-0.5, 0.5, (2, *height.shape)) * side
    row = (slant + u * (sin - across_slope * cos) - v * along_slope * cos - flight.near_m) / radar.range_spacing_m
    column = (y[:, None] + v) / radar.azimuth_spacing_m - 0.5
    if changes.warp_px:
        shape = tuple(n + 2 * REACH for n in flight.shape)
        at = [row + REACH, column + REACH]
        moved = [ndimage.map_coordinates(smooth(rng, shape, 50.0), at, order=1, mode="nearest") for _ in range(2)]
        row, column = row + changes.warp_px * moved[0], column + changes.warp_px * moved[1]
    places = [np.floor((c + REACH) * FINE).astype(np.int64) for c in (row, column)]
    limits = [_places(n) for n in flight.shape]
    seen &= (places[0] >= 0) & (places[0] < limits[0]) & (places[1] >= 0) & (places[1] < limits[1]) & (material > 0)
    return (places[0] * limits[1] + places[1])[seen], power[seen]


def texture(spread_db: float, normal: Doubles) -> Doubles:
    """Gamma variates of mean 1 and a standard deviation in dB, quantiles of a Gaussian field.

    The logarithm of a gamma variate of shape k has the variance trigamma(k) (Oliver and Quegan, Understanding Synthetic
    Aperture Radar Images, 2004, section 5.3, on the K distribution).
    """
    wanted = (spread_db * np.log(10.0) / 10.0) ** 2
    if wanted <= polygamma(1, 1e6):  # below 0.005 dB
        return np.ones_like(normal)
    shape = brentq(lambda k: polygamma(1, k) - wanted, 1e-2, 1e6)
    grid = np.linspace(-6.0, 6.0, 2001)
    return np.interp(normal, grid, gamma.ppf(ndtr(grid), shape) / shape)


def form_image(
    ground: Ground,
    flight: Flight,
    radar: Radar,
    curves: Mapping[str, Curve],
    changes: Changes | None = None,
    rng: np.random.Generator | None = None,
    looks: int | None = None,
) -> Doubles:
    """Form an image: mean power over independent looks, in the radiometry of the image.

    Parameters
    ----------
    ground : Ground
        Ground that is imaged; it should reach some cells beyond the image.
    flight : Flight
        Track and grid of the image.
    radar : Radar
        Section ``radar`` of the case: resolutions, spacings, looks, noise and radiometry.
    curves : mapping
        Law of each material: sigma0 [dB] at the local incidence [rad].
    changes : Changes, optional
        What the case does not say.
    rng : Generator, optional
        Generator of all random numbers.
    looks : int, optional
        Number of looks; by default that of the pass.

    Returns
    -------
    ndarray, shape (rows, columns)
        Power of each pixel.
    """
    changes, rng = changes or Changes(), rng or np.random.default_rng()
    place, power = echoes(ground, flight, radar, curves, changes, rng)
    rows, columns = flight.shape
    along = response(rows, changes.coarser * radar.range_resolution_m / radar.range_spacing_m)
    across = response(columns, changes.coarser * radar.azimuth_resolution_m / radar.azimuth_spacing_m)
    size = (_places(rows), _places(columns))

    # noise-equivalent sigma0 of level ground; a pixel's share of it falls on each of its fine places
    if not isinstance(radar.nesz_db, float):
        raise TypeError("radar.nesz_db: expected one number")
    slant = flight.near_m + ((np.arange(size[0]) + 0.5) / FINE - REACH) * radar.range_spacing_m
    noise = np.full(size[0], 10.0 ** ((radar.nesz_db + changes.noise_db) / 10.0) / FINE**2)
    if (changes.radiometry or radar.radiometry) == "beta0":
        noise /= np.sqrt(1.0 - (flight.height_m / slant) ** 2)

    amplitude, floor, image = np.sqrt(power / 2.0), np.sqrt(noise / 2.0)[:, None], np.zeros(flight.shape)
    n = looks or round(radar.looks)
    for _ in range(2 * n):  # real and imaginary parts: circular Gaussian amplitudes, fully developed speckle
        field_ = np.bincount(place, amplitude * rng.standard_normal(power.size), minlength=size[0] * size[1])
        field_ = field_.reshape(size) + floor * rng.standard_normal(size, dtype=np.float32)
        image += (across @ (along @ field_).T).T ** 2
    return image / n * 10.0 ** (changes.level_db / 10.0)

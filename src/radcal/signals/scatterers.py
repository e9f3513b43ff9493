"""Scatterers of a scene: facets, walls, double bounces and point scatterers, with places and complex amplitudes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.config.part import Part
from radcal.radar.facets import ANGLES_PER_RADIAN, OBJECT, ROOF, VISIBLE
from radcal.radar.geometry import PointScatterers
from radcal.radar.points import phased
from radcal.radar.projection import LitFacets, lit_facets
from radcal.radar.reflectivity import law_tables
from radcal.scene.model import Scene
from radcal.seeds import derived_seed
from radcal.speckle.gaussian import gaussian_row, seed_words
from radcal.standing.faces import Echoes

_Some = tuple[NDArray[np.float64], NDArray[np.complex64]]  # places and amplitudes
_AT_ONCE = 1 << 18  # scatterers whose random numbers are drawn at once, which bounds the work space


@dataclass(frozen=True)
class Scatterers:
    """Point scatterers, sorted along the track.

    Attributes
    ----------
    place_m : ndarray of float64, shape (n, 3)
        Azimuth, ground range and elevation [m].
    amplitude : ndarray of complex64, shape (n,)
        Amplitude, whose squared magnitude is the cross-section [m]. It is the same at all pulses.
    """

    place_m: NDArray[np.float64]
    amplitude: NDArray[np.complex64]

    @classmethod
    def sorted(cls, place_m: NDArray[np.float64], amplitude: NDArray[np.complex64]) -> Scatterers:
        """Scatterers in any order."""
        order = np.argsort(place_m[:, 0], kind="stable")
        return cls(place_m[order], amplitude[order])


def scatterers(case: Part, scene: Scene, seed: int, facet_m: float) -> Scatterers:
    """Scatterers of a scene with the laws of a case.

    Parameters
    ----------
    case : Part
        Configuration of the pass, with the laws and parameters of its materials.
    scene : Scene
        Scene with elevation.
    seed : int
        Noise seed, on which the amplitudes depend.
    facet_m : float
        Largest length of a facet along the track [m]. In slant range no scatterer stands for more than half a
        resolution cell.

    Returns
    -------
    Scatterers
        Visible facets, lit walls and double bounces, with circular Gaussian amplitudes, and visible point scatterers,
        with random phases. Visibility and incidence are those at zero Doppler on the straight track.
    """
    tables = law_tables(scene.names, case.laws, case.start_parameters)
    return drawn_on(facets_of(case.radar, scene, facet_m), tables, case.radar, seed)


def facets_of(radar: Radar, scene: Scene, facet_m: float) -> LitFacets:
    """Facets of at most a length along the track [m], with their heights."""
    return lit_facets(scene, radar, math.ceil(scene.cell_m / facet_m - 1e-9))


def drawn_on(lit: LitFacets, tables: NDArray[np.float32], radar: Radar, seed: int) -> Scatterers:
    """Scatterers of facets by the tables of :func:`law_tables`; what a table of zeros stands for is left out."""
    found = [part(lit, tables, 0.5 * radar.range_resolution_m, seed) for part in (_facets, _upright)]
    place, amplitude = zip(*found, _points(lit, tables, seed), strict=True)
    return Scatterers.sorted(np.concatenate(place), np.concatenate(amplitude))


def _facets(lit: LitFacets, tables: NDArray[np.float32], longest_m: float, seed: int) -> _Some:
    """Places and amplitudes of the visible facets of ground, boxes and roofs."""
    lines = lit.lines
    line, facet = np.nonzero(lines.state & VISIBLE)
    state, cell = lines.state[line, facet], lit.material[line // lit.view.k, facet // lit.view.k]
    cell[(state & OBJECT) > 0] = len(tables) - 1
    roof = state >> ROOF
    cell[roof > 0] = lit.roofs[roof[roof > 0] - 1]
    power = lines.area[line, facet] * tables[cell, lines.incidence[line, facet]]
    number = (line * lines.state.shape[1] + facet).astype(np.uint32)
    near, far, key = lines.near_m[line, facet], lines.far_m[line, facet], derived_seed(seed, "facets")
    whole, slant, drawn = _divided(near, far, power, number, longest_m, key)
    height = lines.height_m[line, facet][whole].astype(np.float64)
    return _places(lit, (line[whole] + 0.5) * lit.view.step_m, slant + lit.view.base_m, height), drawn


def _upright(lit: LitFacets, tables: NDArray[np.float32], longest_m: float, seed: int) -> _Some:
    """Places and amplitudes of walls, and of double bounces, which have the phase of the wall's foot."""
    found, view = Echoes.joined(lit.lines.echoes), lit.view
    ground = lit.material[found.line // view.k, found.facet // view.k]
    angle = (np.radians(np.nan_to_num(found.alpha_deg)) * ANGLES_PER_RADIAN).round().astype(np.intp)
    power = found.area_m2 * np.where(np.isnan(found.alpha_deg), tables[-1, 0], tables[ground, angle])
    number, key = np.arange(power.size, dtype=np.uint32), derived_seed(seed, "walls")
    whole, slant, drawn = _divided(found.near_m, found.far_m, power, number, longest_m, key)
    away = found.away_m[whole]
    height = view.track_m - np.sqrt(slant**2 - away**2)
    return np.stack([(found.line[whole] + 0.5) * view.step_m, away, height], axis=1), drawn


def _divided(
    near: NDArray[Any], far: NDArray[Any], power: NDArray[Any], number: NDArray[np.uint32], longest_m: float, key: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.complex64]]:
    """Index of the scatterer, slant range and drawn amplitude of parts of at most a length in slant range [m]."""
    parts = np.where(power > 0.0, np.maximum(1, np.ceil((far - near) / longest_m)), 0).astype(np.int64)
    whole = np.repeat(np.arange(parts.size), parts)
    part = np.arange(whole.size) - np.repeat(np.cumsum(parts) - parts, parts)
    share = ((part + 0.5) / parts[whole]).astype(np.float32)
    slant = (near[whole] + share * (far - near)[whole]).astype(np.float64)
    drawn = circular(number[whole], part, key)
    drawn *= np.sqrt(power[whole] / parts[whole].astype(np.float32))
    return whole, slant, drawn


def _places(
    lit: LitFacets, azimuth_m: NDArray[Any], slant_m: NDArray[Any], height_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Places whose slant range at zero Doppler is the given one, at the given elevation."""
    ground = np.sqrt(np.maximum(slant_m**2 - (lit.view.track_m - height_m) ** 2, 0.0))
    return np.stack([azimuth_m, ground, height_m], axis=1)


def circular(number: NDArray[Any], part: NDArray[Any], seed: int) -> NDArray[np.complex64]:
    """Circular Gaussian numbers of unit mean power, by the two numbers of each, as of a scatterer and its part."""
    key, out = seed_words(seed), np.empty(number.size, np.complex64)
    words, halves = np.empty((2, _AT_ONCE), np.uint32), np.empty((2, _AT_ONCE), np.float32)
    for first in range(0, number.size, _AT_ONCE):
        n = min(_AT_ONCE, number.size - first)
        some = slice(first, first + n)
        counters = number[some].astype(np.uint32), part[some].astype(np.uint32)
        gaussian_row(n, *counters, np.uint32(0), key, words, halves[0], halves[1])
        out[some].real, out[some].imag = halves[0, :n], halves[1, :n]
    return out


def _points(lit: LitFacets, tables: NDArray[np.float32], seed: int) -> _Some:
    """Places and amplitudes of the visible point scatterers; their phases are those of the fast image."""
    if lit.spots is None or not tables[-1, 0]:
        return np.empty((0, 3)), np.empty(0, np.complex64)
    seen = np.isfinite(lit.spots.slant_m)
    slant, (along, across) = lit.spots.slant_m[seen], lit.spots.place[seen].T * lit.view.step_m
    height = lit.view.track_m - np.sqrt(slant**2 - (lit.view.edges_m[0] + across) ** 2)
    amplitude = np.sqrt(lit.spots.rcs_m2[seen]).astype(np.float32)
    points = PointScatterers(slant, along, amplitude, lit.spots.number[seen])
    return _places(lit, along, slant, height), phased(points, seed).view(np.complex64)[:, 0]

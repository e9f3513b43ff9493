"""Laws used outside their valid incidence angles or parameters, and parameters in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from numpy.typing import ArrayLike

from radcal.config.part import Part
from radcal.findings import Finding
from radcal.radar.geometry import Geometry

_AT_BOUND = 1e-3  # share of the interval between bounds within which a value is at its bound
_SHARE = 0.05  # share of a material's pixels outside the law's valid angles above which a note is made


def law_notes(case: Part, geometry: Geometry, parameters: Mapping[str, ArrayLike]) -> list[Finding]:
    """Findings on laws that are used outside their valid incidence angles or parameters.

    Parameters
    ----------
    case : Part
        Laws by material.
    geometry : Geometry
        Geometry with the incidence of every material's visible pixels.
    parameters : mapping
        Parameters of each material's law in the final runs.

    Returns
    -------
    list of Finding
        One for each material, calibrated or fixed, with more than 5 % of its pixels outside the law's valid
        angles, or with parameters outside the range of the law's data.
    """
    found = []
    for name, law in case.laws.items():
        if name not in geometry.names or not law.has_curve:
            continue
        called = str(case.materials[name].law)
        share = law.outside(geometry.incidence_deg.ravel()[geometry.pixels(name)])
        if share > _SHARE:
            low, high = law.valid_deg
            numbers: dict[str, float | str] = {
                "share_percent": 100.0 * share,
                "from_angle_deg": low,
                "to_angle_deg": high,
            }
            found.append(Finding("outside_angles", "note", name, {**numbers, "law": called}))
        doubt = law.doubt(parameters[name]) if law.doubt is not None else None
        if doubt is not None:
            found.append(Finding("outside_data", "note", name, {"law": called, "doubt": doubt}))
    return found


def at_bound(value: float, low: float, high: float) -> str:
    """Bound that a value has reached, ``lower`` or ``upper``; empty if it has reached neither."""
    margin = _AT_BOUND * (high - low)
    return "lower" if value - low <= margin else "upper" if high - value <= margin else ""


def found_words(
    values: Mapping[str, float],
    bounds: Sequence[Sequence[float]],
    low: Mapping[str, float] | None = None,
    high: Mapping[str, float] | None = None,
) -> str:
    """Text of the calibrated parameters with their 90 % intervals, such as ``mv 0.21 (5 to 95 %: 0.17 to 0.26)``.

    Parameters
    ----------
    values : mapping
        Calibrated value by name of the parameter.
    bounds : sequence, shape (d, 2)
        Bounds of each parameter; of a value at a bound, the bound itself is written, because further digits have no
        meaning.
    low, high : mapping, optional
        5 % and 95 % quantile by name of the parameter; None without a posterior.
    """
    parts = []
    for (name, value), ends in zip(values.items(), bounds, strict=True):
        side = at_bound(value, *ends)
        remarks = [f"at its {side} bound"] if side else []
        if low is not None and high is not None:
            remarks.append(f"5 to 95 %: {low[name]:.3g} to {high[name]:.3g}")
        text = f"{ends[0] if side == 'lower' else ends[1]:g}" if side else f"{value:.4g}"
        parts.append(f"{name} {text}" + (f" ({'; '.join(remarks)})" if remarks else ""))
    return ", ".join(parts)

"""Hidden laws and mismatches of the synthetic measured images (twins) of ``benchmarks/twins.py``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.budget import FIELD_FREEDOM
from radcal.config import Case, case_from
from radcal.radar.geometry import Geometry
from radcal.radar.laws import LAWS, Law, seen_rad
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng

CROP = (slice(120, 280), slice(150, 270))  # cells of the scene: north, east
KNOTS_DEG = [float(angle) for angle in range(0, 91, 5)]
UNDISTURBED: dict[str, Any] = {
    "laws": {}, "offset_db": 0.0, "warp_px": 0.0, "relief_m": 0.0, "resolution_factor": 1.0, "looks": None,
    "nesz_db": None, "texture_db": 0.0, "fields_db": {}, "wrong_labels": 0.0,
}  # fmt: skip

Curve = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Bench:
    """Default case, the part of its scene that is imaged, and the calibrated material."""

    case: Case
    scene: Scene
    geometry: Geometry
    material: str

    @property
    def seen(self) -> NDArray[np.float64]:
        """Local incidence of the calibrated material [deg]."""
        return self.incidence(self.material)

    def incidence(self, name: str) -> NDArray[np.float64]:
        """Local incidence of a material's pixels [deg]."""
        return self.geometry.incidence_deg.ravel()[self.geometry.pixels(name, 1)].astype(np.float64)


@cache
def bench() -> Bench:
    """Case, scene and geometry; once in each process."""
    case = case_from({})
    scene = make_scene(case.scene, list(case.materials))
    assert scene.elevation_m is not None
    part = replace(
        scene,
        material=np.ascontiguousarray(scene.material[CROP]),
        elevation_m=np.ascontiguousarray(scene.elevation_m[CROP]),
        identity=f"{scene.identity} {CROP}",
    )
    return Bench(case, part, make_geometry(part, case.radar), case.calibrated[0])


def either(rng: np.random.Generator, low: float, high: float) -> float:
    """Number whose absolute value is uniform between two limits, of either sign."""
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))


def relief(rng: np.random.Generator) -> dict[str, Any]:
    """Relief below the cells: slopes of 1 to 3 degrees (rms) that the elevation model does not show."""
    length_m = float(rng.uniform(4.0, 8.0))
    slope = np.tan(np.radians(rng.uniform(1.0, 3.0)))  # rms along one axis: sqrt(2) rms height / length
    return {"relief_m": float(slope * length_m / np.sqrt(2.0)), "relief_length_m": length_m}


def point_spread(rng: np.random.Generator) -> dict[str, Any]:
    """Resolution 10 to 30 % coarser, or 10 % finer, as far as the pixel spacing samples it."""
    return {"resolution_factor": float(rng.choice([0.9, 1.1, 1.2, 1.3]))}


def level(rng: np.random.Generator) -> dict[str, Any]:
    """Level 0.5 to 1 dB off."""
    return {"offset_db": either(rng, 0.5, 1.0)}


def others(rng: np.random.Generator) -> dict[str, Any]:
    """Laws of all other materials 2 to 3 dB off, each in its own direction."""
    return {"laws": shifted({name: either(rng, 2.0, 3.0) for name in neighbours()})}


def texture(rng: np.random.Generator) -> dict[str, Any]:
    """Gamma texture of 1 to 2 dB, correlated over 5 to 20 m: K-distributed pixels."""
    return {"texture_db": float(rng.uniform(1.0, 2.0)), "texture_length_m": float(rng.uniform(5.0, 20.0))}


def labels(_: np.random.Generator) -> dict[str, Any]:
    """Class map of which 2 % are wrong."""
    return {"wrong_labels": 0.02}


def noise(rng: np.random.Generator) -> dict[str, Any]:
    """Noise floor 5 to 10 dB below the darkest material; the calibrated one follows when its law is drawn."""
    return {"noise_below_db": float(rng.uniform(5.0, 10.0))}


def warp(rng: np.random.Generator) -> dict[str, Any]:
    """Smooth misregistration of 1 to 3 pixels (rms)."""
    return {"warp_px": float(rng.uniform(1.0, 3.0))}


def outside(rng: np.random.Generator) -> dict[str, Any]:
    """Hidden law outside of the family of the calibrated one: oh1992, or the law with a bump of 0.5 to 1 dB."""
    if rng.random() < 0.5:
        bounds = np.array(LAWS["oh1992"].bounds)
        return {"oh1992": (bounds[:, 0] + rng.random(3) * np.ptp(bounds, axis=1)).tolist()}
    low, high = np.degrees(seen_rad(bench().seen))[[0, -1]]
    return {"bump": [either(rng, 0.5, 1.0), float(rng.uniform(low, high)), 6.0]}


def fields(rng: np.random.Generator) -> dict[str, Any]:
    """Levels of fields that differ as the prior of the configured uncertainty says, for each material."""
    scale_db = bench().case.uncertainty.field_db * np.sqrt(FIELD_FREEDOM / rng.chisquare(FIELD_FREEDOM))
    materials = [*bench().case.calibrated, *neighbours()]
    return {"fields_db": {name: float(abs(rng.normal(0.0, min(scale_db, 6.0)))) for name in materials}}


def together(rng: np.random.Generator) -> dict[str, Any]:
    """All factors but the law's family; level, resolution and fields are drawn from the configured uncertainty."""
    found: dict[str, Any] = {}
    for factor in (relief, texture, labels, noise, warp):
        found |= factor(rng)
    budget = bench().case.uncertainty
    found["resolution_factor"] = float(np.clip(rng.normal(1.0, budget.point_spread), 0.9, 1.5))
    found["offset_db"] = float(rng.normal(0.0, budget.level_db))
    found["laws"] = shifted({name: float(rng.normal(0.0, 2.0)) for name in neighbours()})
    return found | fields(rng)


FACTORS: dict[str, Callable[[np.random.Generator], dict[str, Any]]] = {
    "none": lambda _: {}, "relief": relief, "point_spread": point_spread, "level": level, "others": others,
    "texture": texture, "labels": labels, "noise": noise, "warp": warp, "fields": fields,
    "outside": outside, "all": together,
}  # fmt: skip


def neighbours() -> list[str]:
    """Materials that are not calibrated."""
    return [name for name, material in bench().case.materials.items() if not material.calibrate]


def tabulated(curve: Curve) -> dict[str, Any]:
    """Hidden law with the values of a curve at knots."""
    return {
        "law": "tabulated",
        "angles_deg": KNOTS_DEG,
        "parameters": [float(v) for v in curve(np.radians(KNOTS_DEG))],
    }


def shifted(shift_db: dict[str, float]) -> dict[str, Any]:
    """Hidden laws of materials whose level is off [dB]."""
    case = bench().case
    return {
        name: tabulated(lambda phi, n=name, d=db: case.laws[n](phi, case.materials[n].start_parameters) + d)  # type: ignore[misc]
        for name, db in shift_db.items()
    }


def hidden_law(seed: int, sizes: dict[str, Any]) -> tuple[dict[str, Any], Curve]:
    """Keys of a synthetic measurement for a hidden law, and its curve [dB]."""
    b = bench()
    low, high = np.array(b.case.materials[b.material].box).T
    x = low + derived_rng(seed, "twins", "truth").random(len(low)) * (high - low)
    law: Law = b.case.laws[b.material]
    other = sizes.pop("laws", {})
    if "oh1992" in sizes:
        x, law = sizes.pop("oh1992"), LAWS["oh1992"].bound(**conditions(b.case))
        return {"laws": {**other, b.material: {"law": "oh1992", "parameters": x}}}, partial(_of, law, x)
    if "bump" in sizes:
        size, centre, width = sizes.pop("bump")
        bump = {"size": size, "centre": centre, "width": width}
        curve = partial(_bumped, law, x, bump)
        knots = [float(a) for a in np.arange(0.0, 90.1, 1.0)]
        hidden = {"law": "tabulated", "angles_deg": knots, "parameters": curve(np.radians(knots)).tolist()}
        return {"laws": {**other, b.material: hidden}}, curve
    return {"laws": other, "parameters": {b.material: x.tolist()}}, partial(_of, law, x)


def conditions(case: Case) -> dict[str, Any]:
    """Conditions of a law: frequency [GHz] and polarisation."""
    return {"frequency_ghz": case.radar.frequency_ghz or 9.6, "polarisation": case.radar.polarisation}


def _of(law: Law, x: Sequence[float], phi: NDArray[np.float64]) -> NDArray[np.float64]:
    return law(phi, x)


def _bumped(law: Law, x: Sequence[float], bump: dict[str, float], phi: NDArray[np.float64]) -> NDArray[np.float64]:
    away = (np.degrees(phi) - bump["centre"]) / bump["width"]
    return np.asarray(law(phi, x) + bump["size"] * np.exp(-0.5 * away**2))


def darkest_db(curve: Curve) -> float:
    """Level of the darkest material, at the median of its incidence [dB]."""
    b = bench()
    levels = [float(curve(np.radians(np.median(b.seen))))]  # type: ignore[arg-type]
    for name in neighbours():
        if (angle := b.incidence(name)).size:
            x = b.case.materials[name].start_parameters
            levels.append(float(b.case.laws[name](np.radians(np.median(angle)), x)))
    return min(levels)


def carrier(case: Case) -> dict[str, Any]:
    """Carrier frequency, on which a hidden law may depend, where the case has none."""
    return {} if case.radar.frequency_ghz else {"radar": {"frequency_ghz": 9.6}}

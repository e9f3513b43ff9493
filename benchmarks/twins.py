"""Calibration of twins whose measured images come from an image former that is not the simulator.

    python benchmarks/twins.py [--quick] [--kinds undisturbed,level_2] [--seeds 20] [--first-seed 0] [--jobs 2]
                                       [--out FILE] [--save FOLDER]
    python benchmarks/twins.py --check [--looks 256]

A twin is a part of the default case's scene with a hidden law, drawn uniformly in the bounds of the calibrated
material. ``benchmarks/outside_image.py`` forms the measured image of the twin, disturbed as the kind of the twin says
(``docs/evidence/twins.md``); the image is written to a GeoTIFF, read like any measured file, and calibrated by radcal's
own stages. ``--check`` compares undisturbed images of the former with the simulator's.

Each finished twin is one line of the file ``--out`` and is not made again. ``--save`` also keeps image, runs and
geometry of each twin. The last line printed is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from outside_image import Changes, Curve, Flight, Ground, form_image, mangia, oh
from scipy.ndimage import binary_dilation

from radcal.assessment.conclusion import conclude, withheld
from radcal.assessment.model import image_of, posterior_of
from radcal.assessment.observation import observe, simulated_of
from radcal.calibration.loop import calibrate, register_rounds
from radcal.calibration.steps import all_parameters, noise_seed
from radcal.calibration.stopping import decide
from radcal.config import Case, case_from
from radcal.config.stages import STAGES
from radcal.errors import RadcalError
from radcal.ground.patches import patches_seen
from radcal.measurement.sources import make_measurement
from radcal.measurement.synthetic import make_synthetic
from radcal.objectives import make_objectives, objective_class
from radcal.objectives.history import History
from radcal.radar.geometry import Geometry
from radcal.radar.projection import make_geometry
from radcal.registration.registered import Registered
from radcal.scene.builtin import builtin_scene
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.sections.measurement import Synthetic
from radcal.seeds import derived_rng, derived_seed, draw_seeds
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets
from radcal.targets.target_fit import make_targets
from radcal.words import headline

CROP = (slice(120, 280), slice(150, 270))  # cells of the scene: north, east
ANGLES = 19  # between the 5 % and 95 % quantiles of the incidence
WIDE_DEG = 5.0
WALKERS = 64  # half of the default: enough for the tests of convergence, in half of the time
BEYOND = 12  # cells of ground that are imaged on each side of the scene of the case
MICRO_DEG, MICRO_M = 0.5, 3.0  # relief below the cells that the ground of every twin has
FEET = 3.28084  # in a metre
BRIGHT_DB, MANY = 10.0, 2000  # above the noise, and pixels, of a material whose law may be wrong alone
FREQUENCY_GHZ = 9.6
RADIOMETRIES = ("sigma0_ref", "sigma0_local")
FORM_ANGLES, FORM_DEG = np.arange(0.0, 91.0, 2.0), 8.0  # of errors of a law's form that priors give
FREEDOM, FIELD_LOG_SD, FIELD_SPREAD, CELL_DB = 4.0, 0.42, 1.0, 0.4  # of the priors (docs/uncertainty.md)


@dataclass(frozen=True)
class Twin:
    """What is wrong in a twin.

    Attributes
    ----------
    seed : int
        Seed of the twin.
    changes : Changes
        Changes of the image.
    declared : str
        Radiometry of the case.
    fixed_db : mapping
        Error of a fixed law at the median incidence of its pixels [dB], and change of this error per 10 degrees [dB].
    forms_db : mapping
        Error of a law's form at :data:`FORM_ANGLES` [dB], by material.
    bump : (float, float, float), optional
        Height [dB], place and standard deviation [deg] of a bump in the hidden law.
    oh1992 : (float, float, float), optional
        Hidden law of bare soil: permittivity, its imaginary part, and rms height [cm].
    depression_deg : float, optional
        Depression of the flight, if it is not that of the case [deg].
    feet : bool
        Whether the elevations of the case are in feet.
    elsewhere : bool
        Whether the image shows another place.
    focused : bool
        Whether the image is focused from radcal's own raw signals, which the simulator of the runs does not share.
    """

    seed: int
    changes: Changes = field(default_factory=lambda: Changes(micro_deg=MICRO_DEG, micro_m=MICRO_M))
    declared: str = "sigma0_ref"
    fixed_db: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    forms_db: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    bump: tuple[float, float, float] | None = None
    oh1992: tuple[float, float, float] | None = None
    depression_deg: float | None = None
    feet: bool = False
    elsewhere: bool = False
    focused: bool = False

    def but(self, **changed: Any) -> Twin:
        """Twin with other changes of the image."""
        return replace(self, changes=replace(self.changes, **changed))


@dataclass(frozen=True)
class Bench:
    """Case, the part of its scene that is imaged, geometry, and calibrated material."""

    case: Case
    scene: Scene
    whole: Scene
    geometry: Geometry
    material: str

    def incidence(self, name: str) -> NDArray[np.float64]:
        """Local incidence of a material's pixels [deg]."""
        return self.geometry.incidence_deg.ravel()[self.geometry.pixels(name, 1)].astype(np.float64)

    def curve(self, name: str) -> Curve:
        """Law of a fixed material."""
        assert self.case.materials[name].law == "mangia"
        return partial(mangia, tuple(self.case.materials[name].start_parameters))

    @property
    def fixed(self) -> list[str]:
        """Fixed materials of which there are pixels."""
        return [name for name in self.scene.names if name != self.material and self.incidence(name).size]

    @property
    def bright(self) -> list[str]:
        """Fixed materials with many pixels, well above the noise."""
        floor = float(self.case.radar.nesz_db) + BRIGHT_DB  # type: ignore[arg-type]
        angles = {name: self.incidence(name) for name in self.fixed}
        return [
            name
            for name, seen in angles.items()
            if seen.size >= MANY and self.curve(name)(np.radians(np.median(seen))) >= floor
        ]


def sections(declared: str, feet: bool) -> dict[str, Any]:
    """Sections of the case of a twin.

    With elevations in feet, all of the dyke is in layover. Bare soil is then calibrated in its place, and the dyke has
    the law that is hidden in the default case.
    """
    radar = {"radiometry": declared}
    if not feet:
        return {"radar": radar}
    materials: dict[str, Any] = {
        name: {"parameters": list(material.start_parameters)} for name, material in case_from({}).materials.items()
    }
    materials["bare_soil"] = {"calibrate": True, "bounds": case_from({}).materials["dyke"].box}
    materials["dyke"] = {"parameters": [-24.0, 10.0, 14.0, 5.0]}
    return {"radar": radar, "materials": materials}


@cache
def bench(declared: str = "sigma0_ref", feet: bool = False) -> Bench:
    """Case of a radiometry, scene and geometry; once in each process."""
    case = case_from(sections(declared, feet))
    whole = make_scene(case.scene, list(case.materials))
    assert whole.elevation_m is not None
    scene = replace(
        whole,
        material=np.ascontiguousarray(whole.material[CROP]),
        elevation_m=np.ascontiguousarray(whole.elevation_m[CROP]) * (FEET if feet else 1.0),
        identity=f"{whole.identity} {CROP}" + " in feet" * feet,
    )
    return Bench(case, scene, whole, make_geometry(scene, case.radar), case.calibrated[0])


def flown(b: Bench, scene: Scene, depression_deg: float | None = None) -> Flight:
    """Flight past a scene, with the scene's middle at the same pixel as in the case."""
    radar, g = b.case.radar, b.geometry
    assert radar.depression_deg is not None
    assert scene.elevation_m is not None
    height = radar.altitude_m
    near = height / np.cos(np.radians(g.flat_incidence_deg[0]))
    declared, true = (np.radians(d or radar.depression_deg) for d in (None, depression_deg))
    return Flight(
        track_x_m=scene.elevation_m.shape[1] * scene.cell_m / 2.0 - height / np.tan(true),
        track_z_m=float(scene.elevation_m.mean()) + height,
        height_m=height,
        near_m=near + height / np.sin(true) - height / np.sin(declared),
        shape=g.shape,
    )


def imaged(whole: Scene, crop: tuple[slice, slice]) -> Ground:
    """Ground of a part of a scene and, on each side, some cells beyond it."""
    first = [max(0, part.start - BEYOND) for part in crop]
    wide = tuple(
        slice(start, min(size, part.stop + BEYOND))
        for start, part, size in zip(first, crop, whole.material.shape, strict=True)
    )
    corner = [(start - part.start) * whole.cell_m for start, part in zip(first, crop, strict=True)]
    assert whole.elevation_m is not None
    return Ground(
        whole.elevation_m[wide],
        whole.material[wide].astype(np.int64),
        whole.names,
        whole.cell_m,
        (corner[0], corner[1]),
    )


def wrong_laws(rng: np.random.Generator, twin: Twin, low: float, high: float, slope: float) -> Twin:
    """All fixed laws off by some dB, of either sign, with normal slope errors."""
    return replace(twin, fixed_db={n: (either(rng, low, high), rng.normal(0.0, slope)) for n in bench().fixed})


def sloped(rng: np.random.Generator, twin: Twin) -> Twin:
    """Slopes of all fixed laws off by 0.5 dB per 10 degrees, of either sign."""
    return replace(twin, fixed_db={name: (0.0, either(rng, 0.5, 0.5)) for name in bench().fixed})


def one_fixed(rng: np.random.Generator, twin: Twin) -> Twin:
    """One fixed law 2 dB off."""
    return replace(twin, fixed_db={str(rng.choice(bench().bright)): (either(rng, 2.0, 2.0), 0.0)})


def either(rng: np.random.Generator, low: float, high: float) -> float:
    """Number whose absolute value is uniform between two limits, of either sign."""
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))


def write_tif(path: Path, image_db: NDArray[np.float32]) -> None:
    """Write an image in power as a GeoTIFF without a georeference."""
    import rasterio

    height, width = image_db.shape
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an image in slant range has no georeference
        with rasterio.open(
            path, "w", driver="GTiff", height=height, width=width, count=1, dtype="float32", nodata=np.nan
        ) as file:
            file.write(10.0 ** (image_db / 10.0), 1)


def finished(path: Path) -> list[dict[str, Any]]:
    """Twins of a file; a last line that a kill has cut is left out and ended."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    rows = []
    for line in text.splitlines():
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    if text and not text.endswith("\n"):
        with path.open("a", encoding="utf-8") as file:
            file.write("\n")
    return rows


def bumped(rng: np.random.Generator, twin: Twin) -> Twin:
    """Bump of 2 dB in the hidden law."""
    low, high = np.percentile(bench().incidence(bench().material), [5.0, 95.0])
    return replace(twin, bump=(either(rng, 2.0, 2.0), float(rng.uniform(low, high)), 6.0))


def soil(rng: np.random.Generator, twin: Twin) -> Twin:
    """Hidden law of another family: bare soil, within the range of the surfaces that were measured for it."""
    return replace(twin, oh1992=(rng.uniform(5.0, 18.0), rng.uniform(0.0, 6.0), rng.uniform(0.32, 3.02)))


def textured(rng: np.random.Generator, twin: Twin) -> Twin:
    """Texture of 1 to 2 dB (K-distributed pixels)."""
    return twin.but(texture_db=rng.uniform(1.0, 2.0), texture_m=rng.uniform(5.0, 20.0))


def radiometry(_: np.random.Generator, twin: Twin, formed: str) -> Twin:
    """Image of another radiometry than that of the case."""
    return replace(twin, declared=next(r for r in RADIOMETRIES if r != formed)).but(radiometry=formed)


def everything(rng: np.random.Generator, twin: Twin) -> Twin:
    """All small mismatches together, and a wrong radiometry in one twin of four, in either direction."""
    if twin.seed % 4 == 3:
        twin = radiometry(rng, twin, RADIOMETRIES[twin.seed // 4 % 2])
    b = bench()
    fixed = {name: (rng.normal(0.0, 1.0), rng.normal(0.0, 0.3)) for name in b.fixed}
    return textured(rng, replace(twin, fixed_db=fixed)).but(
        level_db=rng.normal(0.0, 0.33),
        fields_db=dict.fromkeys(b.fixed, 0.5),
        shifts_db={b.material: rng.normal(0.0, 0.5)},
        coarser=float(np.clip(rng.normal(1.0, 0.1), 0.85, 1.3)),
        wrong_labels=0.02,
        noise_db=rng.normal(0.0, 1.0),
        warp_px=rng.uniform(1.0, 2.0),
        micro_deg=rng.uniform(1.0, 2.5),
        micro_m=rng.uniform(3.0, 8.0),
    )


def from_priors(rng: np.random.Generator, twin: Twin) -> Twin:
    """All that the assessment does not know, drawn from its priors, but for errors of the incidence and of the area."""
    b, u = bench(), bench().case.uncertainty
    away = (FORM_ANGLES[:, None] - FORM_ANGLES) / FORM_DEG
    root = np.linalg.cholesky(np.exp(-0.5 * away**2) + 1e-8 * np.eye(FORM_ANGLES.size))
    form, own_form, law = np.abs(rng.normal(0.0, [u.form_db, u.form_db, u.fixed_law_db]))
    scales = law / np.sqrt(rng.chisquare(FREEDOM, len(b.fixed)) / FREEDOM)
    common = np.log(u.field_db) + FIELD_LOG_SD * rng.standard_normal()
    made = replace(
        twin,
        fixed_db={
            n: (rng.normal(0.0, s), rng.normal(0.0, u.fixed_slope * s)) for n, s in zip(b.fixed, scales, strict=True)
        },
        forms_db={
            n: tuple((sd * root @ rng.standard_normal(FORM_ANGLES.size)).tolist())
            for n, sd in [*((n, form) for n in b.fixed), (b.material, own_form)]
        },
    )
    return made.but(
        level_db=u.level_db * rng.standard_t(FREEDOM),
        fields_db={n: float(np.exp(rng.normal(common, FIELD_SPREAD))) for n in [*b.fixed, b.material]},
        coarser=float(np.clip(rng.normal(1.0, u.point_spread), 0.7, 1.4)),
        noise_db=rng.normal(0.0, u.noise_db),
        texture_db=abs(rng.normal(0.0, CELL_DB)),
        texture_m=60.0,
    )


KINDS: dict[str, Callable[[np.random.Generator, Twin], Twin]] = {
    "undisturbed": lambda _, twin: twin,
    "ref_as_local": partial(radiometry, formed="sigma0_ref"),
    "local_as_ref": partial(radiometry, formed="sigma0_local"),
    "local": lambda _, twin: replace(twin, declared="sigma0_local"),
    "level_04": lambda rng, twin: twin.but(level_db=either(rng, 0.4, 0.4)),
    "level_2": lambda rng, twin: twin.but(level_db=either(rng, 2.0, 2.0)),
    "one_fixed": one_fixed,
    "all_fixed": partial(wrong_laws, low=1.0, high=3.0, slope=0.0),
    "slopes": sloped,
    "one_field": lambda rng, twin: twin.but(shifts_db={bench().material: either(rng, 0.8, 0.8)}),
    "bump": bumped,
    "another_law": soil,
    "point_spread": lambda _, twin: twin.but(coarser=1.3),
    "texture": textured,
    "labels": lambda _, twin: twin.but(wrong_labels=0.03),
    "depression_5": lambda rng, twin: replace(twin, depression_deg=45.0 + either(rng, 5.0, 5.0)),
    "depression_2": lambda rng, twin: replace(twin, depression_deg=45.0 + either(rng, 2.0, 2.0)),
    "feet": lambda _, twin: replace(twin, feet=True),
    "elsewhere": lambda _, twin: replace(twin, elsewhere=True),
    "focused": lambda _, twin: replace(twin, focused=True),
    "everything": everything,
    "priors": from_priors,
}
GROUPS = {  # names that --kinds also takes
    "radiometry": ["ref_as_local", "local_as_ref"],
    "one_thing": [
        "ref_as_local", "local_as_ref", "level_04", "level_2", "one_fixed", "all_fixed", "one_field", "bump",
        "another_law", "point_spread", "texture", "labels",
    ],
    "geometry": ["depression_5", "depression_2", "feet", "elsewhere"],
}  # fmt: skip


def hidden(kind: str, seed: int) -> tuple[Twin, tuple[float, ...], Curve]:
    """Twin of a kind and a seed, X of its hidden law, and the curve [dB] (another one for a law of another form)."""
    made = KINDS[kind](derived_rng(seed, "outside", kind), Twin(seed))
    b = bench(made.declared, made.feet)
    low, high = np.array(b.case.materials[b.material].box).T
    x = tuple((low + derived_rng(seed, "outside", kind, "truth").random(len(low)) * (high - low)).tolist())
    curve: Curve = partial(mangia, x)
    if made.oh1992 is not None:
        real, imaginary, rms_cm = made.oh1992
        curve = partial(oh, complex(real, -imaginary), rms_cm, FREQUENCY_GHZ)
    if made.bump is not None:
        size, centre, width = made.bump
        curve = partial(_bumped, curve, size, centre, width)
    return made, x, _formed(made, b.material, curve)


def _bumped(curve: Curve, size: float, centre: float, width: float, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    return curve(phi) + size * np.exp(-0.5 * ((np.degrees(phi) - centre) / width) ** 2)


def _formed(made: Twin, name: str, curve: Curve) -> Curve:
    """Curve of a material with the error of its form."""
    if name not in made.forms_db:
        return curve
    error = np.array(made.forms_db[name])
    return lambda phi: curve(phi) + np.interp(np.degrees(phi), FORM_ANGLES, error)


def _off(curve: Curve, level: float, slope: float, middle: float, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    return curve(phi) + level + slope * (np.degrees(phi) - middle) / 10.0


def measured_image(made: Twin, curve: Curve, rng: np.random.Generator) -> NDArray[np.float64]:
    """Power of the measured image of a twin, on the pixels of its case."""
    b, true = bench(made.declared, made.feet), bench(made.declared)
    curves = {name: b.curve(name) for name in b.scene.names if name != b.material} | {b.material: curve}
    curves = {name: one if name == b.material else _formed(made, name, one) for name, one in curves.items()}
    for name, (level, slope) in made.fixed_db.items():
        curves[name] = partial(_off, curves[name], level, slope, float(np.median(b.incidence(name))))
    whole, crop, scene = true.whole, CROP, true.scene
    if made.elsewhere:
        whole = builtin_scene(int(rng.integers(100, 1 << 20)), "enclosed")
        assert whole.elevation_m is not None
        start = [
            int(rng.integers(BEYOND, n - BEYOND - m)) for n, m in zip(whole.material.shape, (160, 120), strict=True)
        ]
        crop = (slice(start[0], start[0] + 160), slice(start[1], start[1] + 120))
        scene = replace(whole, elevation_m=whole.elevation_m[crop], material=whole.material[crop])
    flight = flown(b, scene, made.depression_deg)
    return form_image(imaged(whole, crop), flight, b.case.radar, curves, made.changes, rng)


def focused_image(b: Bench, x: Sequence[float], seed: int) -> NDArray[np.float64]:
    """Power of an image of a hidden law that is focused from raw signals of the scene."""
    synthetic = Synthetic(product="focused", parameters={b.material: list(x)}, seed=seed, warp_px=0.0)
    simulator = BuiltinSimulator(b.geometry, b.case.radar, b.case.laws)
    image_db = make_synthetic(STAGES["measurement"].of(b.case), synthetic, b.geometry, simulator, b.scene).image_db
    return np.asarray(10.0 ** (image_db.astype(np.float64) / 10.0))


def twin(kind: str, seed: int, save: Path | None = None) -> dict[str, Any]:
    """One finished twin: what is wrong in it, the hidden law, and what its calibration says.

    With ``save``, the folder ``<save>/<kind>_<seed>`` keeps the image, the run store and ``twin.npz``.
    """
    began = time.time()
    made, x, curve = hidden(kind, seed)
    row: dict[str, Any] = {"kind": kind, "seed": seed, "wrong": asdict(made), "hidden": list(x)}
    b = bench(made.declared, made.feet)
    if made.focused:
        power = focused_image(b, x, derived_seed(seed, "outside", kind, "image", bits=31))
    else:
        power = measured_image(made, curve, derived_rng(seed, "outside", kind, "image"))
    phi = np.radians(np.linspace(*np.percentile(b.incidence(b.material), [5.0, 95.0]), ANGLES))
    row |= {"angles_deg": np.degrees(phi).tolist(), "truth_db": curve(phi).tolist()}
    row["formed_s"] = round(time.time() - began, 2)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) if save is None else save / f"{kind}_{seed}"
        folder.mkdir(parents=True, exist_ok=True)
        path = (folder / "image.tif").resolve()
        write_tif(path, 10.0 * np.log10(power).astype(np.float32))
        measured = {"source": "file", "path": str(path), "scale": "power", "radiometry": made.declared}
        settings = {"uncertainty": {"walkers": WALKERS}, "simulator": {"keep_images": True}}
        case = case_from({"measurement": measured, **settings, **sections(made.declared, made.feet)})
        try:
            row |= calibrated(case, b, folder, phi, row if save is not None else None)
        except RadcalError as error:
            row |= {"refused": str(error)}
    return row | {"seconds": round(time.time() - began, 2)}


def calibrated(
    case: Case, b: Bench, folder: Path, phi: NDArray[np.float64], saved: dict[str, Any] | None
) -> dict[str, Any]:
    """Calibration of a case whose measured image is a file, and what it says of the law at some angles [rad]."""
    simulator = BuiltinSimulator(b.geometry, case.radar, case.laws)
    runner = Runner(
        RunStore(folder / "runs"), simulator, b.geometry, b.scene.identity, STAGES["reference_run"].of(case)
    )
    measurement = make_measurement(STAGES["measurement"].of(case), b.geometry, simulator, b.scene)
    registered, run = register_rounds(case, [runner], b.geometry, measurement, b.scene)
    stage = STAGES["target"].of(case)
    start = runner.run(case.start_parameters, noise_seed(case), image=True).image_db
    targets = make_targets(stage, b.geometry, registered, start, objective_class(stage.objective).misfit, scene=b.scene)
    history, decision = calibrate(case, [runner], [targets], registration=run)
    found = {"runs": len(history.runs), "ended": str(decision.reason), "registration": registered.verdict}
    if saved is not None:
        keep(case, b, folder, runner, history, registered, saved)
    return found | band(case, b, runner, targets, history, registered, folder / "runs", phi)


def band(
    case: Case,
    b: Bench,
    runner: Runner,
    targets: Targets,
    history: History,
    registered: Registered,
    runs: Path,
    phi: NDArray[np.float64],
) -> dict[str, Any]:
    """Posterior of a calibrated case: sigma0 and its 90 % band at angles [rad], where it is determined, and findings.

    This is the only function that knows the assessment.
    """
    name, angles = b.material, np.degrees(phi)
    stage = STAGES["posterior"].of(case)
    parameters = all_parameters(case.materials, {name: history.best(name).parameters})
    final = [runner.run(parameters, noise_seed(case, fresh), image=fresh) for fresh in (False, True)]
    images = simulated_of(stage, b.scene, [b.geometry], [(run, parameters) for run in final], str(runs / "draws"))
    cells = [observe(stage, b.geometry, registered, images[0], targets.levels, b.scene)]
    image = image_of(stage, cells)
    objectives = make_objectives(stage, [targets])
    posterior = posterior_of(stage, [targets], history, objectives[name], cells, image)
    archive = STAGES["archive"].of(case)
    final_db = final[1].image_db
    assert final_db is not None
    findings = conclude(
        archive, history, [targets], objectives, b.geometry, final_db, {name: posterior}, image, [registered]
    )
    posterior = withheld(posterior, findings)
    low, high = posterior.known_between_deg or (np.inf, -np.inf)
    curve = posterior.curve
    assert curve is not None
    quantiles = {
        key: np.interp(angles, curve.incidence_deg, getattr(curve, key)).tolist()
        for key in ("median_db", "p05_db", "p95_db", "field_p05_db", "field_p95_db")
    }
    assert posterior.parameters_model is not None
    law = case.laws[name](phi, posterior.parameters_model)
    return {
        **quantiles,
        "law_model_db": law.tolist(),
        "determined": ((angles >= low) & (angles <= high)).tolist(),
        "refuted": bool(posterior.form is not None and posterior.form.refuted),
        "sampled": posterior.sampled and image.sampled,
        "findings": [asdict(one) for one in findings],
        "codes": [one.code for one in findings if one.severity != "note"],
        "line": headline([name], findings, decide(history, [name], case.stop, case.objective).converged),
    }


def keep(
    case: Case,
    b: Bench,
    folder: Path,
    runner: Runner,
    history: History,
    registered: Registered,
    row: dict[str, Any],
) -> None:
    """Write ``twin.npz`` and ``case.json``: what an assessment needs, without a new run.

    The image as registered (``measured_db``) and before; displacement and its standard error; X and images of all runs
    with all draws (``x``, ``run_db``), the final runs (``best``, ``final_db``), the draws of a run of ``best`` in the
    other radiometry of sigma0_ref and sigma0_local; the geometry; and the hidden law at the 19 angles (``angles_deg``,
    ``truth_db``). A pixel of ``field`` is 0 outside of all fields, and else 1,000 times the material id plus the number
    of the field.
    """
    g, name = b.geometry, b.material
    x = np.array([run.scores[name].parameters for run in history.runs])
    best = history.best(name).parameters
    seeds = draw_seeds(STAGES["reference_run"].of(case))

    def images(values: Sequence[float], seeds: Sequence[int]) -> NDArray[np.float32]:
        parameters = all_parameters(case.materials, {name: list(values)})
        return np.stack([runner.run(parameters, seed, image=True).image_db for seed in seeds])  # type: ignore[misc]

    other = next(r for r in RADIOMETRIES if r != case.radar.radiometry)
    its = bench(other) if b.scene is bench(case.radar.radiometry).scene else None
    geometry = its.geometry if its else make_geometry(b.scene, case.radar.model_copy(update={"radiometry": other}))
    simulator = BuiltinSimulator(geometry, case.radar.model_copy(update={"radiometry": other}), case.laws)
    final = all_parameters(case.materials, {name: best})
    material = g.material
    fields = np.zeros(g.shape, dtype=np.int32)
    for number in range(1, len(g.names) + 1):
        seen = patches_seen(material == number, b.scene.material == number, g.ground)
        fields = np.where(seen > 0, seen + 1000 * number, fields)
    np.savez(
        folder / "twin.npz",
        measured_db=registered.measurement.image_db,
        unregistered_db=registered.unregistered_db,
        displacement_px=registered.displacement_px,
        uncertainty_px=registered.uncertainty_px,
        correlation=registered.correlation,
        applied=registered.applied,
        kind_of_run=np.array([run.kind for run in history.runs]),
        x=x,
        run_db=np.stack([images(one, seeds) for one in x]),
        best=best,
        final_db=images(best, [noise_seed(case), noise_seed(case, True)]),
        other_radiometry=other,
        other_db=np.stack([simulator.run(final, seed) for seed in seeds]),
        names=np.array(g.names),
        material=material,
        field=fields,
        incidence_deg=g.incidence_deg,
        flat_incidence_deg=g.flat_incidence_deg,
        layover=g.layover,
        shadow=g.shadow,
        visible=g.visible,
        ground=g.ground,
        start=np.array([[*case.materials[n].start_parameters] for n in g.names]),
        nesz_db=case.radar.nesz_db,
        angles_deg=row["angles_deg"],
        truth_db=row["truth_db"],
        hidden=row["hidden"],
    )
    (folder / "case.json").write_text(json.dumps({"case": case.model_dump(mode="json"), "twin": row}, indent=1))


def check(looks: int) -> dict[str, Any]:
    """Differences between undisturbed images of the former and of the simulator, by material and incidence [dB].

    Pixels with layover, shadow or another material within three pixels are left out. Speckle of neighbours
    is correlated: with the default resolutions and spacings, 3.4 pixels count as one.
    """
    largest: dict[str, float] = {}
    for declared in (*RADIOMETRIES, "beta0"):
        b = bench(declared)
        parameters = {n: list(m.start_parameters) for n, m in b.case.materials.items()}
        parameters[b.material] = [-24.0, 10.0, 14.0, 5.0]
        curves = {n: partial(mangia, tuple(x)) for n, x in parameters.items()}
        ground = imaged(b.whole, CROP)
        rng = derived_rng(1, "outside", "check", declared)
        former = form_image(ground, flown(b, b.scene), b.case.radar, curves, rng=rng, looks=looks)
        simulator = BuiltinSimulator(b.geometry, b.case.radar, b.case.laws)
        draws = looks // round(b.case.radar.looks)
        seeds = [derived_seed(k, "outside", "check", declared, bits=31) for k in range(draws)]
        runs = [simulator.run(parameters, seed) for seed in seeds]
        ours = np.mean([10.0 ** (run.astype(np.float64) / 10.0) for run in runs], axis=0)
        near = binary_dilation(b.geometry.layover | b.geometry.shadow, np.ones((7, 7)))
        print(f"\n{declared}\n{'material':10} {'incidence':>9} {'pixels':>6} {'difference':>10}  standard error [dB]")
        for name in b.scene.names:
            pixels = b.geometry.pixels(name, 3)
            pixels = pixels[~near.ravel()[pixels]]
            angle = b.geometry.incidence_deg.ravel()[pixels]
            for low, high in [(0, 90), *((a, a + 5) for a in range(0, 90, 5))]:
                here = pixels[(angle >= low) & (angle < high)]
                if here.size < 200:
                    continue
                difference = 10.0 * np.log10(former.ravel()[here].mean() / ours.ravel()[here].mean())
                error = 10.0 / np.log(10.0) * np.sqrt(2.0 * 3.4 / here.size / looks)
                print(f"{name:10} {f'{low} to {high}':>9} {here.size:6d} {difference:10.3f}  {error:.3f}")
                if (low, high) == (0, 90):
                    largest[f"{declared} {name}"] = round(float(difference), 4)
    return {"looks": looks, "difference_db": largest, "largest_db": max(abs(d) for d in largest.values())}


def single_threaded(job: tuple[str, int, Path | None]) -> dict[str, Any]:
    """One twin on one core."""
    import numba

    from radcal.processes import one_thread

    numba.config.NUMBA_NUM_THREADS = 1
    with one_thread():
        return twin(*job)


def figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures of some twins; one without a band excludes nothing and determines nothing.

    ``excluded`` counts the twins whose band leaves the truth out at more than half of the angles, and
    ``excluded_determined`` those at more than half of the determined angles. ``coverage_error`` is the standard error
    of the coverage by twins.
    """
    found = [row for row in rows if "median_db" in row]
    low, high, truth, median = (
        np.array([row[key] for row in found]).reshape(-1, ANGLES)
        for key in ("p05_db", "p95_db", "truth_db", "median_db")
    )
    determined = np.array([row["determined"] for row in found], dtype=bool).reshape(-1, ANGLES)
    inside = (low <= truth) & (truth <= high)
    out = np.where(determined.any(axis=1), (~inside & determined).sum(axis=1) > determined.sum(axis=1) / 2.0, False)
    share = inside.mean(axis=1) if found else np.empty(0)
    codes = sorted({code for row in found for code in row["codes"]})
    step = np.array([np.diff(row["angles_deg"])[0] for row in found])
    wide = (np.array([longest(line) for line in determined]) - 1) * step >= WIDE_DEG if found else np.empty(0)
    return {
        "n": len(rows),
        "no_band": len(rows) - len(found),
        "excluded": int((share < 0.5).sum()),
        "excluded_determined": int(out.sum()),
        "coverage_90": float(share.mean()) if found else None,
        "coverage_error": float(share.std(ddof=1) / np.sqrt(len(found))) if len(found) > 1 else None,
        "half_width_db": float(np.median((high - low).mean(axis=1) / 2.0)) if found else None,
        "error_db": float(np.median(np.abs(median - truth))) if found else None,
        "determined_5_deg": int(wide.sum()),
        "refuted": sum(bool(row["refuted"]) for row in found),
        "sampled": sum(bool(row["sampled"]) for row in found),
        "codes": {code: sum(code in row["codes"] for row in found) for code in codes},
    }


def longest(values: NDArray[np.bool_]) -> int:
    """Length of the longest unbroken row of true values."""
    best = now = 0
    for value in values:
        now = now + 1 if value else 0
        best = max(best, now)
    return best


def table(rows: list[dict[str, Any]], kinds: Sequence[str]) -> dict[str, Any]:
    """Print the figures of each kind, and give them."""
    head = ("n", "no_band", "excluded", "excluded_determined", "coverage_90", "half_width_db", "error_db")
    head = (*head, "determined_5_deg", "refuted", "sampled")
    print("\n" + f"{'kind':13}" + "".join(f" {name:>{max(8, len(name))}}" for name in head))
    every = {}
    for kind in kinds:
        every[kind] = one = figures([row for row in rows if row["kind"] == kind])
        cells = ["-" if one[n] is None else f"{one[n]:.2f}" if isinstance(one[n], float) else str(one[n]) for n in head]
        line = "".join(f" {cell:>{max(8, len(n))}}" for n, cell in zip(head, cells, strict=True))
        print(f"{kind:13}{line}  {one['codes'] or ''}")
    return every


def main() -> None:
    """Make the twins that are missing, print the table and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare former and simulator instead")
    parser.add_argument("--looks", type=int, default=256, help="looks of the images of --check")
    parser.add_argument("--quick", action="store_true", help="1 seed of each kind")
    parser.add_argument("--seeds", type=int, default=20, help="twins of each kind")
    parser.add_argument("--first-seed", type=int, default=0, help="number of the first seed")
    parser.add_argument("--kinds", default=",".join(KINDS), help="which, with commas; also " + ", ".join(GROUPS))
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/outside.jsonl"), help="file of finished twins")
    parser.add_argument("--save", type=Path, help="folder for image, runs and geometry of each twin")
    a = parser.parse_args()
    if a.check:
        print(json.dumps(check(a.looks)))
        return
    kinds = [kind for name in a.kinds.split(",") for kind in GROUPS.get(name, [name])]
    if unknown := set(kinds) - set(KINDS):
        parser.error(f"--kinds: {', '.join(sorted(unknown))}, expected some of {', '.join([*KINDS, *GROUPS])}")
    seeds = range(a.first_seed, a.first_seed + (1 if a.quick else a.seeds))
    wanted = [(kind, seed) for seed in seeds for kind in kinds]
    a.out.parent.mkdir(parents=True, exist_ok=True)
    rows = {(row["kind"], row["seed"]): row for row in finished(a.out)}
    missing = [(*job, a.save) for job in wanted if job not in rows]
    with (
        a.out.open("a", encoding="utf-8") as file,
        ProcessPoolExecutor(a.jobs, mp_context=get_context("spawn")) as pool,
    ):
        for row in (map if a.jobs == 1 else pool.map)(single_threaded, missing):
            rows[row["kind"], row["seed"]] = row
            file.write(json.dumps(row) + "\n")
            file.flush()
            os.fsync(file.fileno())
            print(
                f"{row['kind']:13} {row['seed']:3d} {row['seconds']:6.1f} s  {row.get('line') or row['refused']}",
                flush=True,
            )
    made = [rows[job] for job in wanted]
    every = table(made, kinds)
    print(json.dumps({**figures(made), "kinds": every}))


if __name__ == "__main__":
    main()

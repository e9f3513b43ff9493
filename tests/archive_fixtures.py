"""Small archives, written by the library from made-up runs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from archives import image, posterior, without_curve
from calibration_samples import make_score, make_target
from config_samples import COMMAND
from geometry_samples import of_pixels

from radcal import skewnormal
from radcal.config import Case, RegistrationConfig, case_from
from radcal.config.stages import STAGES
from radcal.ground.goodness import Goodness
from radcal.image.model import Measurement
from radcal.inference.moments import from_dp
from radcal.objectives.history import History, PassScore, Proposal, Run
from radcal.products.export import write_export
from radcal.radar.geometry import Geometry
from radcal.registration.registered import Registered, register
from radcal.results.archive import read_archive
from radcal.results.results import archive_of
from radcal.scene.model import Scene
from radcal.storage.runs import Record, RunStore, write_index
from radcal.targets.target import Targets

HIDDEN = [6.1, 14.2, 21.5, 3.3]
# the density's xi is this far from the target's in successive runs, per material
SHIFTS = {
    "dyke": {"reference": [9.0], "design": [5.0, -6.0, 2.0, 4.0], "infill": [0.2, 1e-6]},
    "stem beans": {"reference": [-40.0], "design": [3.0, 1.0, -7.0, 2.0], "infill": [0.5, 0.6]},
}


@dataclass(frozen=True)
class Made:
    """An archive and what it was made from."""

    path: Path
    case: Case
    history: History
    targets: Targets
    final: tuple[Record, Record]
    registered: Registered
    geometry: Geometry
    scene: Scene
    passes: Sequence[Registered] = ()

    @property
    def archive(self):
        """What the file holds."""
        return read_archive(self.path)

    def gathered(self, path, **changes):
        """Results of the same calibration but for some arguments, written and read back."""
        at = SimpleNamespace(
            **{**vars(self), "runs": self.path.parent / "runs", "image": image(), "every": [self.targets], **changes}
        )
        case = STAGES["archive"].of(at.case)
        each = [posterior() if case.laws[name].has_curve else without_curve() for name in at.targets]
        archive = archive_of(
            case, at.history, at.scene, at.geometry, at.passes or [at.registered], at.every, at.runs,
            at.final, each, at.image,
        )  # fmt: skip
        archive.write(path)
        return read_archive(path)

    def exported(self, folder, archive=None, scene=None, geometry=None):
        """Write the exports of an archive, of this one by default."""
        archive, case, final = archive or self.archive, STAGES["archive"].of(self.case), folder / "final.json"
        write_index(final, [])
        of_pass = [geometry or self.geometry], [archive.registered]
        files = write_export(folder, case, archive, scene or self.scene, *of_pass, final, folder / "runs")
        final.unlink()
        return files


def make_archive(
    folder,
    *,
    shifts=None,
    hidden=("dyke",),
    floors=None,
    shape=(40, 30),
    source="synthetic, seed 2",
    omega=3.0,
    nan=False,
    moved=False,
    external=False,
    other_start=(),
):
    """Write an archive: every material a stripe, all numbers made up but consistent.

    ``external``: the laws of the dyke and of the fixed material are the simulator's alone.
    """
    shifts = SHIFTS if shifts is None else shifts
    floors = {"stem beans": [None, 0.05]} if floors is None else floors
    names = [*shifts, "unused"]
    rng = np.random.default_rng(7)
    materials = {
        **{name: {"calibrate": True, "start": [10.0, 10.0, 10.0, 10.0]} for name in shifts},
        "unused": {"parameters": [1.0, 2.0, 3.0, 4.0]},
    }
    for name in other_start:
        materials[name]["start"] = {"law": "constant_gamma", "parameters": [-12.0]}
    if external:
        materials["unused"] = {"law": "external"}
        materials["dyke"] |= {"law": "external", "names": ["mv", "s", "l", "t"], "bounds": [[0, 50]] * 4}
    case = case_from(
        {
            "case": "small",
            "simulator": COMMAND if external else {},
            "materials": materials,
            "objective": "density",
            "measurement": {"source": "synthetic", "synthetic": {"parameters": dict.fromkeys(other_start, HIDDEN)}},
            "design": {"size": len(next(iter(shifts.values()))["design"])},
            "stop": {"rms": 1e-4, "max_runs": 50, "stagnation_runs": 20},
        }
    )

    stripe = (np.arange(max(shape)) * len(names)) // max(shape) + 1
    axis = 0 if shape[0] >= shape[1] else 1
    material = np.broadcast_to(np.expand_dims(stripe, 1 - axis), shape).astype(np.uint8).copy()
    material[0, 0] = 0
    incidence = np.linspace(20.0, 50.0, material.size).reshape(shape).astype(np.float32)
    geometry = of_pixels(tuple(names), material, incidence, flat_incidence_deg=np.linspace(20.0, 50.0, shape[0]))

    def simulated():
        u = np.abs(rng.standard_normal(shape))
        return (-12.0 + material + omega * (-0.8 * u + 0.6 * rng.standard_normal(shape))).astype(np.float32)

    measured = simulated()
    if nan:
        np.moveaxis(measured, axis, 0)[:, : min(shape) // 5] = np.nan
        measured[rng.random(shape) < 0.02] = np.nan
    measurement = Measurement(measured, source, dict.fromkeys(hidden, HIDDEN))

    each = {}
    for name in shifts:
        visible = geometry.pixels(name)
        eligible = visible[np.isfinite(measured.ravel()[visible])]
        drawn = np.sort(rng.choice(eligible, size=min(120, eligible.size), replace=False))
        beans = name == "stem beans"
        each[name] = make_target(
            measured.ravel()[drawn], incidence.ravel()[drawn], pixels=drawn, order=np.searchsorted(visible, drawn),
            eligible=int(eligible.size), at_boundary=beans, effective=100.0, rms_sampling=0.004,
            cp_error=np.array([0.2, 0.1, 0.15]) * (np.nan if beans else 1.0), looks=1.2 if beans else 3.0,
            left_out={"near other ground": 12, "without data": 3}, goodness=Goodness(0.04, 0.01 if beans else 0.3),
        )  # fmt: skip
    targets = Targets(each, looks=3.1)

    def record(key):
        values = simulated()
        return Record(key, {name: values.ravel()[geometry.pixels(name)] for name in shifts}, values, 0.5)

    runs = []
    ended = dict.fromkeys(shifts, False)
    for kind in ("reference", "design", "infill"):
        for index in range(len(next(iter(shifts.values()))[kind])):
            dp = {
                name: (t.dp + np.array([shifts[name][kind][index], 0.0, 0.0])).tolist() for name, t in targets.items()
            }
            proposals = {}
            if kind == "infill":
                for name in shifts:
                    floor = floors.get(name, [None] * 99)[index]
                    promised = 1e-9 if floor is None else skewnormal.density_rms(dp[name], targets[name].dp)
                    mode = "ended" if ended[name] else "exploit"
                    proposals[name] = Proposal([1.0] * 4, mode, cost=promised, floor=floor)
                    ended[name] |= abs(shifts[name][kind][index]) < 1e-4
            scores = {}
            for name, target in targets.items():
                start = [-12.0] if name in other_start else [10.0, 10.0, 10.0, 10.0]
                rms = skewnormal.density_rms(dp[name], target.dp)
                scores[name] = make_score(
                    rms, start if kind == "reference" else [50.0, *rng.uniform(1, 49, 3).tolist()],
                    densities=[PassScore(dp[name], rms)], statistics=from_dp(dp[name])[None].tolist(),
                    own_law=kind != "reference" or name not in other_start,
                )  # fmt: skip
            key = f"{kind}{index:04d}"
            runs.append(Run(kind, index, [key], seconds=0.1 + 0.2 * index, scores=scores, proposals=proposals))
    history = History(runs)
    registered = register(measured, measurement, RegistrationConfig(method="none"))
    if moved:
        field = np.full((2, *shape), 1.5, dtype=np.float32)
        registered = replace(
            registered, method="gefolki", applied=True, verdict="registered with gefolki: moved.",
            displacement_px=field, uncertainty_px=np.full(shape, 0.2, dtype=np.float32),
            measurement=replace(measurement, misregistration_px=field + 0.5),
        )  # fmt: skip
    RunStore(folder / "runs").put(record(runs[0].keys[0]), {})
    final = (record(runs[-1].keys[0]), record("fresh"))
    scene = Scene("made up", geometry.names, material, np.hypot(*np.indices(shape)), 5.0)
    made = Made(folder / "calibration.h5", case, history, targets, final, registered, geometry, scene)
    made.gathered(made.path)
    return made


@pytest.fixture(scope="session")
def build_archive():
    return make_archive


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Two materials: the dyke converges and is known, stem beans cannot be reached."""
    return make_archive(tmp_path_factory.mktemp("archive"), source="synthetic <b>seed</b> 2 & more")

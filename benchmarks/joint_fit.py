"""Bands of three calibrated materials by the cut, and by one joint sample of all materials and common effects.

    python benchmarks/joint_fit.py [--quick] [--twins 5] [--first-seed 0] [--kinds undisturbed,everything]

radcal samples what the materials with fixed laws say of the effects that all materials share, and then each calibrated
material by itself, given a normal distribution of these effects (the cut). Here, three materials of the part of the
default case's scene that ``twins.py`` images are calibrated: dyke, grass and crops. One sample of all scales, laws and
errors of laws then takes the place of the cut, with the same priors, columns and cells, and the fixed materials have no
other radiometry in either. Printed are the half-widths of the 90 % bands, averaged over the incidence seen, and their
ratio, cut to joint. The hidden laws are drawn uniformly in the bounds of the dyke.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import twins
from numpy.typing import NDArray
from outside_image import form_image, mangia

from radcal.assessment import model as assessment
from radcal.assessment.observation import observe, simulated_of
from radcal.calibration.loop import calibrate, register_rounds
from radcal.calibration.steps import all_parameters, noise_seed
from radcal.config import Case, case_from
from radcal.config.stages import STAGES
from radcal.measurement.sources import make_measurement
from radcal.objectives import make_objectives, objective_class
from radcal.posterior.calibrated import FORMS, Draws, LawModel
from radcal.posterior.fixed_laws import CELL_DB, FIELD_SPREAD, _less, _Scales, half_normal
from radcal.posterior.marginal import integrated, normal_draws
from radcal.posterior.result import Posterior
from radcal.posterior.sampling import sample
from radcal.processes import one_thread
from radcal.radar.projection import make_geometry
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets

Doubles = NDArray[np.float64]

MATERIALS = ("dyke", "grass", "crops")
WALKERS, STEPS, CHUNK = 64, 16000, 128


class Joint:
    """Log density of the scales of the fixed materials, and of X and scales of each calibrated one.

    All linear effects are integrated out: the own ones of each material first, then those that all share.

    Parameters
    ----------
    scales : _Scales
        Density of the scales of the fixed materials.
    models : sequence of LawModel
        Calibrated materials.
    """

    def __init__(self, scales: _Scales, models: Sequence[LawModel]) -> None:
        self.scales, self.models, self.expected = scales, models, scales.expected[0]
        ends = np.cumsum([scales.dimension, *(one.dimension for one in models)])
        self.parts = [slice(*pair) for pair in pairwise(ends)]
        self.turns = [self._turn(one) for one in models]

    @staticmethod
    def _turn(model: LawModel) -> Doubles:
        """Matrix from columns of standard normal effects and values less expected ones to effects and values."""
        root = model._root
        q = len(root)
        turn = np.eye(q + 1)
        turn[:q, :q] = np.linalg.inv(root)
        turn[:q, q] = turn[:q, :q] @ model.common.mean
        return turn

    def log_prior(self, at: Doubles) -> Doubles:
        """Log density of the priors, shape (m, dimension) to (m,)."""
        found = self.scales.log_prior(at[:, : self.scales.dimension])
        for one, part in zip(self.models, self.parts, strict=True):
            field, cell, form = at[:, part][:, one.d :].T
            found = found - 0.5 * (at[:, part][:, : one.d] ** 2).sum(axis=1)
            found -= 0.5 * ((field - at[:, 0]) / FIELD_SPREAD) ** 2
            found += half_normal(cell, CELL_DB) + half_normal(form, one.config.form_db)
        return np.where((np.abs(at) < 9.0).all(axis=1), found, -np.inf)

    def grams(self, at: Doubles) -> tuple[Doubles, Doubles, list[Doubles]]:
        """Gram matrices of the shared columns and values, log densities of the rest, and each model's matrices."""
        total, half = self.scales.gram(at[:, : self.scales.dimension])
        each = []
        for one, part, turn in zip(self.models, self.parts, self.turns, strict=True):
            gram, log_det = one._gram(at[:, part])
            own = one.linear.shape[1] - self.scales.common
            left, of_own = integrated(gram, one._prior_variance(at[:, part])[:, :own], own)
            total = total + turn.T @ left @ turn
            half = half + of_own + 0.5 * log_det - one.law.log_prior(one.law.scaled(at[:, part][:, : one.d]))
            each.append(gram)
        return total, half, each

    def log_likelihood(self, at: Doubles) -> Doubles:
        """Log likelihood of the cells of all materials, shape (m,)."""
        total, half, _ = self.grams(at)
        variance = self.scales.prior_variance(at[:, : self.scales.dimension])
        left, own = integrated(_less(total, self.expected), variance, self.scales.common)
        return np.asarray(-0.5 * left[:, 0, 0] - half - own)

    def drawn(self, seed: int, best: Sequence[Doubles]) -> list[Draws]:
        """Draws of each calibrated material."""
        rng = np.random.default_rng(seed)
        starts = [one.start(WALKERS, rng, x) for one, x in zip(self.models, best, strict=True)]
        start = np.concatenate([self.scales.start(WALKERS, rng), *starts], axis=1)
        found = sample(self.log_prior, self.log_likelihood, start, STEPS, seed)
        at = found.draws
        parts = [self.grams(at[k : k + CHUNK]) for k in range(0, len(at), CHUNK)]
        total = np.concatenate([part[0] for part in parts])
        variance = self.scales.prior_variance(at[:, : self.scales.dimension])
        common = self.expected + normal_draws(_less(total, self.expected), variance, self.scales.common, rng)
        draws = []
        for k, (one, part) in enumerate(zip(self.models, self.parts, strict=True)):
            gram, own = np.concatenate([each[2][k] for each in parts]), one.linear.shape[1] - self.scales.common
            deviates = np.linalg.solve(one._root, (common - one.common.mean).T).T
            right = gram[:, :own, -1] - np.einsum("mij,mj->mi", gram[:, :own, own:-1], deviates)
            joined = np.concatenate([gram[:, :own, :own], right[..., None]], axis=2)
            of_own = normal_draws(joined, one._prior_variance(at[:, part])[:, :own], own, rng)
            x, (field, cell) = one.law.scaled(at[:, part][:, : one.d]), np.exp(at[:, part][:, one.d : -1].T)
            form = of_own[:, one.first_form : one.first_form + FORMS]
            linear = np.concatenate([of_own, deviates], axis=1)
            draws.append(Draws(x, field, cell, form, linear, common, np.zeros(len(x)), found))
        return draws


def case_of(path: Path) -> Case:
    """Case of three calibrated materials whose measured image is a file."""
    default = case_from({}).materials
    materials: dict[str, Any] = {
        name: {"parameters": list(one.start_parameters)} for name, one in default.items() if name not in MATERIALS
    }
    materials |= {name: {"calibrate": True, "bounds": default["dyke"].box} for name in MATERIALS}
    sections: dict[str, Any] = {
        "materials": materials,
        "measurement": {"source": "file", "path": str(path), "scale": "power", "radiometry": "sigma0_ref"},
        "uncertainty": {"walkers": twins.WALKERS},
        "simulator": {"keep_images": True},
    }
    return case_from(sections)


def widths(case: Case, folder: Path, seed: int) -> dict[str, Any]:
    """Half-width of each material's band by the cut and by the joint sample [dB]."""
    b = twins.bench()
    geometry = make_geometry(b.scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, case.laws)
    reference = STAGES["reference_run"].of(case)
    runner = Runner(RunStore(folder / "runs"), simulator, geometry, b.scene.identity, reference)
    measurement = make_measurement(STAGES["measurement"].of(case), geometry, simulator, b.scene)
    registered, run = register_rounds(case, [runner], geometry, measurement, b.scene)
    stage = STAGES["target"].of(case)
    start = runner.run(case.start_parameters, noise_seed(case), image=True).image_db
    targets = make_targets(stage, geometry, registered, start, objective_class(stage.objective).misfit, scene=b.scene)
    history, _ = calibrate(case, [runner], [targets], registration=run)
    stage = STAGES["posterior"].of(case)
    parameters = all_parameters(case.materials, {name: history.best(name).parameters for name in MATERIALS})
    final = [runner.run(parameters, noise_seed(case, fresh), image=fresh) for fresh in (False, True)]
    runs = [(one, parameters) for one in final]
    images = simulated_of(stage, b.scene, [geometry], runs, str(folder / "draws"))
    cells = [observe(stage, geometry, registered, images[0], targets.levels, b.scene)]
    objectives = make_objectives(stage, [targets])
    models: list[LawModel] = []
    bands: list[tuple[Any, ...]] = []

    class Kept(LawModel):
        """Model that is kept when it is drawn from."""

        def drawn(self, seed: int, best: Doubles | None = None) -> Draws:
            models.append(self)
            return super().drawn(seed, best)

    of_band = assessment.with_band

    def with_band(*given: Any) -> Posterior:
        bands.append(given)
        return of_band(*given)

    fixed = [name for name in case.reference_materials if name in cells[0]]
    observed = {
        name: assessment._observed(name, cells, [case.laws[name]], case.materials[name].start_parameters)
        for name in fixed
    }
    areas = assessment._mean_areas(cells)
    whole = assessment.image_of(stage, cells)
    first = next(iter(whole.shared))
    image = replace(whole, shared={first: whole.shared[first]})
    with patch.object(assessment, "LawModel", Kept), patch.object(assessment, "with_band", with_band):
        cut = [assessment.posterior_of(stage, [targets], history, objectives[n], cells, image) for n in MATERIALS]
    with one_thread():
        scales = _Scales(observed, areas, stage.uncertainty, False, {tuple(map(int, first.split())): 1.0})
        best = [np.asarray(history.best(name).parameters) for name in MATERIALS]
        draws = Joint(scales, models).drawn(seed, best)
    joint = [of_band(given[0], given[1], one, *given[3:]) for given, one in zip(bands, draws, strict=True)]
    return {
        "seed": seed,
        "fixed": fixed,
        "radiometry": first,
        "cut_db": [half_width(one) for one in cut],
        "joint_db": [half_width(one) for one in joint],
        "ess": round(draws[0].sample.ess),
        "r_hat": round(draws[0].sample.r_hat, 3),
        "sampled": bool(draws[0].sample.converged and image.sampled and all(one.sampled for one in cut)),
    }


def half_width(found: Posterior) -> float:
    """Mean half-width of the band of sigma0 over the incidence seen [dB]."""
    curve = found.curve
    assert curve is not None
    low, high = found.seen_deg.min(), found.seen_deg.max()
    seen = (curve.incidence_deg >= low) & (curve.incidence_deg <= high)
    return float((curve.p95_db - curve.p05_db)[seen].mean() / 2.0)


def twin(kind: str, seed: int) -> dict[str, Any]:
    """Half-widths of a twin whose three calibrated materials have hidden laws."""
    b = twins.bench()
    made = replace(twins.KINDS[kind](derived_rng(seed, "outside", kind), twins.Twin(seed)), declared="sigma0_ref")
    made = made.but(radiometry=None)
    low, high = np.array(b.case.materials[b.material].box).T
    rng = derived_rng(seed, "joint", kind)
    curves = {name: b.curve(name) for name in b.scene.names if name != b.material}
    for name, (level, slope) in made.fixed_db.items():
        curves[name] = partial(twins._off, curves[name], level, slope, float(np.median(b.incidence(name))))
    curves |= {name: partial(mangia, tuple(low + rng.random(len(low)) * (high - low))) for name in MATERIALS}
    power = form_image(
        twins.imaged(b.whole, twins.CROP), twins.flown(b, b.scene), b.case.radar, curves, made.changes, rng
    )
    with tempfile.TemporaryDirectory() as folder:
        path = (Path(folder) / "image.tif").resolve()
        twins.write_tif(path, 10.0 * np.log10(power).astype(np.float32))
        return {"kind": kind} | widths(case_of(path), Path(folder), seed)


def main() -> None:
    """Print a line per twin and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one twin of each kind")
    parser.add_argument("--twins", type=int, default=5, help="number of each kind")
    parser.add_argument("--first-seed", type=int, default=0, help="of the first twin")
    parser.add_argument("--kinds", default="undisturbed,everything", help="kinds of twins.py, with commas")
    arguments = parser.parse_args()
    last = arguments.first_seed + (1 if arguments.quick else arguments.twins)
    rows = []
    for kind in arguments.kinds.split(","):
        for seed in range(arguments.first_seed, last):
            found = twin(kind, seed)
            rows.append(found)
            print(json.dumps(found), flush=True)
    ratios = np.array([row["cut_db"] for row in rows]) / np.array([row["joint_db"] for row in rows])
    summary = {"twins": len(rows), "sampled": sum(row["sampled"] for row in rows)}
    print(
        json.dumps(summary | {"cut_over_joint": float(np.exp(np.log(ratios).mean())), "largest": float(ratios.max())})
    )


if __name__ == "__main__":
    main()

"""Bands of three calibrated materials by the cut, and by one joint sample of all materials and common effects.

    python benchmarks/joint_fit.py [--quick] [--twins 5] [--first-seed 0] [--kinds undisturbed,everything]

radcal samples what the materials with fixed laws say of the effects that all materials share, and then each calibrated
material by itself, given a normal distribution of these effects (the cut). Here, three materials of the part of the
default case's scene that ``twins.py`` images are calibrated: dyke, grass and crops. One sample of all scales, laws and
errors of laws then takes the place of the cut, with the same priors, columns and cells, and the fixed materials have no
other radiometry in either. It is made of the draws of the fixed materials and of each calibrated one by itself. Printed
are the half-widths of the 90 % bands, averaged over the incidence seen, and their ratio, cut to joint, with convergence
of the joint sample and share of its proposals that were accepted. The hidden laws are drawn uniformly in the bounds of
the dyke.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
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
from radcal.posterior.fixed_laws import FIELD_SPREAD, _less, _Scales
from radcal.posterior.marginal import integrated, normal_draws
from radcal.posterior.result import Posterior
from radcal.posterior.sampling import _judged, sample
from radcal.processes import one_thread
from radcal.radar.projection import make_geometry
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets

Doubles = NDArray[np.float64]

MATERIALS = ("dyke", "grass", "crops")
WALKERS, STEPS, CHUNK, THINNED = 64, 2000, 128, 28


class Joint:
    """Draws from the posterior of the scales of the fixed materials, and of X and scales of each calibrated one.

    A state is one draw of the scales of the fixed materials, and one of each calibrated material by itself. In turn,
    one of these is replaced by another, drawn evenly, and the new state is accepted by the ratio of joint and separate
    densities (Metropolis-Hastings with independent proposals; Tierney, Annals of Statistics 22, 1994). All linear
    effects are integrated out: the own ones of each material first, then those that all share.

    Parameters
    ----------
    scales : _Scales
        Density of the scales of the fixed materials.
    models : sequence of LawModel
        Calibrated materials.
    points : sequence of ndarray, shape (m, d)
        Draws of the scales, and of each calibrated material by itself.
    """

    def __init__(self, scales: _Scales, models: Sequence[LawModel], points: Sequence[Doubles]) -> None:
        self.scales, self.models, self.points = scales, models, points
        self.expected, self.common = scales.expected[0], points[0][:, 0]
        self.variance = scales.prior_variance(points[0])
        # of each draw: Gram matrix of the shared columns and the values less expected ones, and minus the log of its
        # separate density without what the joint one has, too
        self.grams = [_less(scales.gram(points[0])[0], self.expected)]
        left, half = integrated(self.grams[0], self.variance, scales.common)
        self.rests, self.of_models = [0.5 * left[:, 0, 0] + half], []
        for one, at in zip(models, points[1:], strict=True):
            # many draws at once are slow
            gram = np.concatenate([one._gram(at[k : k + CHUNK])[0] for k in range(0, len(at), CHUNK)])
            variance, every = one._prior_variance(at), one.linear.shape[1]
            own, turn = every - scales.common, self._turn(one)
            left, half = integrated(gram, variance, every)
            of_shared, of_own = integrated(gram, variance[:, :own], own)
            middle, sd = one.common.field
            field = 0.5 * (at[:, -3] - middle) ** 2 / (sd**2 + FIELD_SPREAD**2)
            self.rests.append(0.5 * left[:, 0, 0] + half - of_own + field)
            self.grams.append(_less(turn.T @ of_shared @ turn, self.expected))
            self.of_models.append(gram)

    @staticmethod
    def _turn(model: LawModel) -> Doubles:
        """Matrix from columns of standard normal effects and values less expected ones to effects and values."""
        root = model._root
        q = len(root)
        turn = np.eye(q + 1)
        turn[:q, :q] = np.linalg.inv(root)
        turn[:q, q] = turn[:q, :q] @ model.common.mean
        return turn

    def log_ratio(self, state: NDArray[np.intp]) -> Doubles:
        """Log of the ratio of joint and separate densities at states, shape (m, 1 + materials) to (m,)."""
        total = sum(gram[at] for gram, at in zip(self.grams, state.T, strict=True))
        left, half = integrated(np.asarray(total), self.variance[state[:, 0]], self.scales.common)
        found = -0.5 * left[:, 0, 0] - half + sum(rest[at] for rest, at in zip(self.rests, state.T, strict=True))
        for at, points in zip(state.T[1:], self.points[1:], strict=True):
            found -= 0.5 * ((points[at, -3] - self.common[state[:, 0]]) / FIELD_SPREAD) ** 2
        return np.asarray(found)

    def drawn(self, seed: int) -> list[Draws]:
        """Draws of each calibrated material."""
        rng = np.random.default_rng(seed)
        sizes = [len(one) for one in self.points]
        state = rng.integers(0, sizes, (WALKERS, len(sizes)))
        now, states, accepted = self.log_ratio(state), np.empty((STEPS, *state.shape), np.intp), 0
        for step in range(STEPS):
            for block, size in enumerate(sizes):
                other = state.copy()
                other[:, block] = rng.integers(0, size, WALKERS)
                ratio = self.log_ratio(other)
                taken = np.log(rng.random(WALKERS)) < ratio - now
                state[taken], now[taken], accepted = other[taken], ratio[taken], accepted + np.count_nonzero(taken)
            states[step] = state
        self.acceptance = accepted / states.size
        each = zip(self.points, np.moveaxis(states, -1, 0), strict=True)
        found = _judged(np.concatenate([points[of] for points, of in each], axis=2))
        kept = states[STEPS // 8 :].reshape(-1, len(sizes))[::THINNED]
        total = np.asarray(sum(gram[at] for gram, at in zip(self.grams, kept.T, strict=True)))
        common = self.expected + normal_draws(total, self.variance[kept[:, 0]], self.scales.common, rng)
        draws = []
        for one, points, grams, of in zip(self.models, self.points[1:], self.of_models, kept.T[1:], strict=True):
            at, gram, own = points[of], grams[of], one.linear.shape[1] - self.scales.common
            deviates = np.linalg.solve(one._root, (common - one.common.mean).T).T
            right = gram[:, :own, -1] - np.einsum("mij,mj->mi", gram[:, :own, own:-1], deviates)
            joined = np.concatenate([gram[:, :own, :own], right[..., None]], axis=2)
            of_own = normal_draws(joined, one._prior_variance(at)[:, :own], own, rng)
            x, (field, cell) = one.law.scaled(at[:, : one.d]), np.exp(at[:, one.d : -1].T)
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
    separate: list[Draws] = []
    bands: list[tuple[Any, ...]] = []

    class Kept(LawModel):
        """Model that is kept when it is drawn from."""

        def drawn(self, seed: int, best: Doubles | None = None) -> Draws:
            models.append(self)
            separate.append(super().drawn(seed, best))
            return separate[-1]

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
        start = scales.start(twins.WALKERS, np.random.default_rng(seed))
        of_scales = sample(scales.log_prior, scales.log_likelihood, start, stage.uncertainty.steps, seed)
        joint = Joint(scales, models, [of_scales.draws, *(one.sample.draws for one in separate)])
        draws = joint.drawn(seed)
    together = [of_band(given[0], given[1], one, *given[3:]) for given, one in zip(bands, draws, strict=True)]
    return {
        "seed": seed,
        "fixed": fixed,
        "radiometry": first,
        "cut_db": [half_width(one) for one in cut],
        "joint_db": [half_width(one) for one in together],
        "acceptance": round(joint.acceptance, 3),
        "ess": round(draws[0].sample.ess),
        "r_hat": round(draws[0].sample.r_hat, 3),
        "sampled": all([draws[0].sample.converged, of_scales.converged, *(one.sampled for one in cut)]),
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

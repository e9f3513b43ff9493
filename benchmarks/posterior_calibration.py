"""Test of the posterior by simulation: how often its 90 % band holds true laws that are drawn from the prior.

    python benchmarks/posterior_calibration.py [--quick] [--truths 60] [--looks 4.0] [--out FILE]

Each truth is a draw from the configured prior: X, looks, variances between and within fields, level, and errors of the
incidence and of the resolutions. Option ``--looks`` fixes the looks. For each truth, 1,000 pixels with independent
speckle lie in one to eight fields, each of several cells. Their mean incidence is 20 to 50 degrees, with a standard
deviation of 4 to 9 degrees. Law and speckle take the place of the simulator, so that the benchmark tests likelihood,
priors and sampler, and no surrogate.

The last line printed gives the share of all whole degrees called known at which the band holds the true sigma0, and the
share of truths that the test of the fit rejects (``does_not_fit``). The last line also gives the rank of the true
sigma0 among the draws, at the mean incidence and at the 5 and 95 % quantiles of the incidence seen, with a chi-squared
test that the ranks are uniform.

Reference: Talts et al., "Validating Bayesian inference algorithms with simulation-based calibration" (2018),
arXiv:1804.06788.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from radcal.assessment.budget import FIELD_FREEDOM, Budget
from radcal.assessment.curves import Curves
from radcal.assessment.field_prior import MOST_FIELD_DB
from radcal.assessment.fit_test import FitTest, check_fit
from radcal.assessment.posterior import draw, sigma0_db, summarised
from radcal.assessment.unknowns import Model
from radcal.calibration.grounds import bins_of, fit_grounds
from radcal.calibration.history import Score
from radcal.calibration.law_fit import LOOKS
from radcal.calibration.misfit import Method
from radcal.calibration.objectives.bins import Bins
from radcal.calibration.objectives.objective import Material
from radcal.calibration.priors import CurvePrior, looks_residuals
from radcal.calibration.surrogate import Surrogate, Training
from radcal.config import Uncertainty
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.goodness import Goodness
from radcal.measurement.ground import Ground
from radcal.measurement.levels import Levels
from radcal.measurement.patches import Spread
from radcal.measurement.target import Target
from radcal.radar.laws import LAWS
from radcal.skewnormal import fit

LAW = LAWS["mangia"]
BOX = np.array([[-60.0, 0.0], [0.0, 50.0], [0.0, 50.0], [0.0, 20.0]])
SENSOR, PIXELS, STATED_DEG, LEVEL_DB = 4.0, 1000, 1.0, -12.0
MEAN_POWER = np.log(10.0) / 20.0


def drawn_law(rng: np.random.Generator, mean_deg: float) -> NDArray[np.float64]:
    """X from bounds and prior of the curve."""
    prior = CurvePrior(LAW, LEVEL_DB, mean_deg)
    while True:
        x = rng.uniform(*BOX.T)
        if np.log(rng.random()) < -0.5 * float((prior.residuals(x) ** 2).sum()):
            return np.asarray(x)


def drawn_looks(rng: np.random.Generator) -> float:
    """Looks from their prior."""
    while True:
        looks = float(np.exp(rng.uniform(np.log(LOOKS[0]), np.log(LOOKS[1] * SENSOR))))
        if np.log(rng.random()) < -0.5 * float((looks_residuals(looks, SENSOR) ** 2).sum()):
            return looks


def drawn_fields(rng: np.random.Generator, budget: Budget) -> float:
    """Standard deviation between or within fields [dB] from its prior, which ends at ``MOST_FIELD_DB``."""
    while True:
        drawn = budget.field_db * abs(float(rng.standard_t(FIELD_FREEDOM)))
        if drawn < MOST_FIELD_DB:
            return drawn


def simulated(seed: int, budget: Budget, looks: float | None) -> tuple[Ground, dict[str, Any]]:
    """Ground of one truth, and the truth."""
    rng = np.random.default_rng(seed)
    mean_deg, sd_deg = rng.uniform(20.0, 50.0), rng.uniform(4.0, 9.0)
    true_deg = np.clip(rng.normal(mean_deg, sd_deg, PIXELS), 1.0, 85.0)
    z = rng.standard_normal(2)
    error = float(budget.incidence_error_deg(np.array([STATED_DEG]), z[:1])[0, 0])
    mapped = np.clip(true_deg + rng.normal(0.0, error, PIXELS), 0.5, 89.0)
    shown = mapped.mean() + budget.steepening(z[1:])[0] * (true_deg - mapped.mean())
    x, n = drawn_law(rng, mean_deg), drawn_looks(rng) if looks is None else looks
    between, within = drawn_fields(rng, budget), drawn_fields(rng, budget)
    # fields with relief of their own, so that they share the bins unequally
    fields = int(rng.integers(1, 9))
    patch = np.argsort(np.argsort(mapped + rng.normal(0.0, 2.0 * sd_deg, PIXELS))) * fields // PIXELS + 1
    block = rng.integers(0, 10, PIXELS)
    cell = patch * 10 + block
    level = LAW(np.radians(np.clip(shown, 0.0, 90.0)), x)
    level = level + rng.normal(0.0, between, fields + 1)[patch] + rng.normal(0.0, within, cell.max() + 1)[cell]
    values = level + rng.normal(0.0, budget.level_db) + 10.0 * np.log10(rng.gamma(n, 1.0 / n, PIXELS))
    truth = {"x": x, "looks": n, "more_db": MEAN_POWER * (between**2 + within**2), "fields": fields}
    return Ground(values, mapped, patch, block), truth


def bins_objective(ground: Ground, bins: ClassTarget) -> Bins:
    """Comparison of a ground's pixels with law and speckle in incidence-angle bins."""
    nothing, count = np.zeros(3), np.arange(PIXELS)
    target = Target(
        count, count, ground.values_db, ground.incidence_deg.astype(np.float32), fit(ground.values_db).dp, PIXELS,
        False, float(PIXELS), 1e-3, nothing, np.zeros((3, 2)), Goodness(0.0, 1.0, 0.0, 1.0), patch=ground.patch,
        block=ground.block, classes=bins,
    )  # fmt: skip
    return Bins(Material("area", target, LAW, BOX, np.zeros(4, dtype=np.bool_), SENSOR))


def model_of(ground: Ground, config: Uncertainty) -> Model:
    """Model of a ground's pixels, on a surrogate that is law and speckle."""
    edges = incidence_edges(ground.incidence_deg, "auto")
    classes = bins_of(ground, "auto")
    assert class_of(ground.incidence_deg, edges).max() == classes.size - 1
    bins = ClassTarget(classes, Spread(0.5, 0.3), 1, True, True, STATED_DEG, BOX.mean(axis=1), SENSOR)
    objective = bins_objective(ground, bins)
    assert objective.baseline is not None
    x = BOX.mean(axis=1)[None]
    training = Training(
        x, objective.baseline(x[0])[None], np.ones((3, 4)), np.full(3, 1e-10), np.ones(3, dtype=np.bool_),
        np.full(3, np.nan), ("trained",) * 3,
    )  # fmt: skip
    return Model(objective, Surrogate(training, objective), [Levels()], config)


def tested(ground: Ground, seed: int) -> FitTest:
    """Test of the law that fits a ground best, as a finished calibration makes it."""
    found = fit_grounds({"area": ground}, {"area": Method(LAW, BOX, SENSOR, incidence_error_deg=STATED_DEG)})["area"]
    x, looks = found.fit.parameters, found.fit.looks
    objective = bins_objective(ground, ClassTarget(found.classes, found.spread, 1, True, True, STATED_DEG, x, looks))
    assert objective.baseline is not None
    score = Score(x.tolist(), [0.0, 1.0, 0.0], 0.0, objective.baseline(x).tolist(), looks, found.fit.cost)
    return check_fit(objective, score, (ground.values_db, ground.values_db), 1.0, np.random.default_rng(seed))


def judged(seed: int, config: Uncertainty, looks: float | None) -> dict[str, Any]:
    """Ranks, coverage and widths of one truth."""
    began = time.perf_counter()
    ground, truth = simulated(seed, Budget.of(config, Levels()), looks)
    model = model_of(ground, config)
    found = draw(model, config, seed)
    posterior = summarised(model, found, config.known_db)
    assert model.curves is not None
    assert posterior.curve is not None
    curve = model.curves(truth["x"][None]) + truth["more_db"]
    draws = sigma0_db(model, found.posterior)
    low, high = model.seen_deg[0]
    at = np.array([[low, float(ground.incidence_deg.mean()), high]])
    rank = (Curves.at(draws, at) < Curves.at(curve, at)).mean(axis=0)
    whole = posterior.curve.incidence_deg
    real = Curves.at(curve, whole[None])[0]
    inside = (real >= posterior.curve.p05_db) & (real <= posterior.curve.p95_db)
    seen = (whole >= low) & (whole <= high)
    known = posterior.known_between_deg
    there = seen & (whole >= known[0]) & (whole <= known[1]) if known else np.zeros_like(seen)
    half = 0.5 * (posterior.curve.p95_db - posterior.curve.p05_db)
    gap = np.abs(real - posterior.curve.median_db)
    test = tested(ground, seed)
    return {
        "seed": seed, "fields": truth["fields"], "sampled": posterior.sampled, "ess": posterior.ess,
        "rank": rank.tolist(), "known": int(there.sum()), "held": int(inside[there].sum()),
        "seen": int(seen.sum()), "held_seen": int(inside[seen].sum()),
        "half_width_db": float(np.median(half[there])) if there.any() else None,
        "error_db": float(np.median(gap[there])) if there.any() else None,
        "fits": test.fits, "p": test.p,
        "looks_held": bool(posterior.looks[0] <= truth["looks"] <= posterior.looks[2]),
        "looks_ratio": float(posterior.looks[1] / truth["looks"]), "seconds": time.perf_counter() - began,
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Pooled figures."""
    from scipy.stats import chisquare

    def total(key: str) -> int:
        return int(sum(row[key] for row in rows))

    ranks = np.array([row["rank"] for row in rows])
    cells = max(4, min(10, len(rows) // 6))
    p = [float(chisquare(np.histogram(column, cells, (0.0, 1.0))[0]).pvalue) for column in ranks.T]
    some = [row for row in rows if row["known"]]
    return {
        "truths": len(rows),
        "coverage_known": total("held") / max(total("known"), 1),
        "coverage_seen": total("held_seen") / total("seen"),
        "rank_p_low_mean_high": p,
        "rank_inside_90": ((ranks > 0.05) & (ranks < 0.95)).mean(axis=0).tolist(),
        "known_somewhere": len(some),
        "half_width_db": float(np.median([row["half_width_db"] for row in some])) if some else None,
        "error_db": float(np.median([row["error_db"] for row in some])) if some else None,
        "looks_coverage": float(np.mean([row["looks_held"] for row in rows])),
        "looks_ratio": float(np.median([row["looks_ratio"] for row in rows])),
        "sampled": total("sampled"),
        "does_not_fit": float(np.mean([row["fits"] is False for row in rows])),
        "seconds": float(np.median([row["seconds"] for row in rows])),
    }


def main() -> None:
    """Judge the truths one by one; those in the file are not repeated."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="8 truths")
    parser.add_argument("--truths", type=int, default=300)
    parser.add_argument("--first", type=int, default=1, help="seed of the first truth")
    parser.add_argument("--looks", type=float, help="looks of all truths; by default drawn from their prior")
    parser.add_argument("--out", type=Path, help="file of the single truths, one JSON object a line")
    options = parser.parse_args()
    rows = (
        [json.loads(line) for line in options.out.read_text().splitlines()]
        if options.out and options.out.exists()
        else []
    )
    done = {row["seed"] for row in rows}
    config = Uncertainty()
    print(f"{'truth':>6} {'fields':>6} {'known':>6} {'held':>5} {'half-width':>11} {'error':>7} {'ESS':>6} {'s':>5}")
    with threadpool_limits(1):
        for seed in range(options.first, options.first + (8 if options.quick else options.truths)):
            if seed in done:
                continue
            row = judged(seed, config, options.looks)
            rows.append(row)
            width, error = (f"{row[key]:.2f}" if row["known"] else "-" for key in ("half_width_db", "error_db"))
            print(
                f"{seed:6} {row['fields']:6} {row['known']:6} {row['held']:5} {width:>11} {error:>7} {row['ess']:6.0f} "
                f"{row['seconds']:5.0f}",
                flush=True,
            )
            if options.out:
                with options.out.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    print(json.dumps(summary(rows)))


if __name__ == "__main__":
    main()

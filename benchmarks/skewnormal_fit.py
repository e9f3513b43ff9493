"""Comparison of radcal's skew-normal fit with scipy's, on random samples of all skewnesses and many sizes.

    python benchmarks/skewnormal_fit.py [--quick] [--critical]

The samples have n = 50 to 5,000 values (log-uniform). Mean, standard deviation and skewness of the densities are drawn
uniformly, the skewness over nearly its whole range. A failure is a result that is not finite, or a mean log-likelihood
that is more than 1e-6 below that of ``scipy.stats.skewnorm.fit``, started from its own default. Times are medians for
1,000 values.

The second table gives the share of samples whose 95 % intervals (``skewnormal.intervals``) hold the true parameters.
With ``--critical``, the program instead simulates, in about 10 minutes, the critical values of the likelihood ratio of
the true skewness. The 95 % intervals use these critical values, which are ``_RATIOS`` in ``skewnormal.profile``.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, skewnorm

from radcal import skewnormal
from radcal.processes import one_thread
from radcal.skewnormal import likelihood, profile

DEFICIT = 1e-6
SIZES = (50, 100, 200, 500, 1000, 3000)
SKEWNESSES = (0.0, 0.3, 0.6, 0.8, 0.9, 0.97)
CRITICAL_SIZES = (50, 100, 200, 400, 800)
CRITICAL_SKEWNESSES = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.993, 0.9945, 0.9951, skewnormal.MAX_SKEWNESS)


def sample(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Random skew-normal numbers of a random density."""
    skewness = rng.uniform(-0.99, 0.99)
    xi, omega, alpha = skewnormal.direct([rng.uniform(-40.0, 40.0), rng.uniform(1.0, 8.0), skewness])
    delta = alpha / np.hypot(1.0, alpha)
    u0, u1 = rng.standard_normal((2, n))
    # Azzalini and Capitanio 2014, eq. 2.13
    return xi + omega * (delta * np.abs(u0) + np.sqrt(1.0 - delta**2) * u1)


def scipy_fit(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scipy's maximum likelihood as (xi, omega, alpha)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        alpha, xi, omega = skewnorm.fit(x)
    return np.array([xi, omega, alpha])


def of_skewness(skewness: float, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Values of the skew normal of mean 0, standard deviation 1; half-normal ones at the largest skewness."""
    if skewness >= skewnormal.MAX_SKEWNESS:
        return np.abs(rng.standard_normal(n))
    return skewnormal.sample(skewnormal.direct([0.0, 1.0, skewness]), n, rng)


def coverage(n: int, skewness: float, replications: int) -> dict[str, float]:
    """Share of samples whose intervals hold mean, standard deviation and skewness."""
    rng = np.random.default_rng([3, n, round(1000 * skewness)])
    truth = np.array([0.0, 1.0, skewness])
    inside = np.zeros(3)
    for _ in range(replications):
        x = of_skewness(skewness, n, rng)
        low, high = skewnormal.intervals(x, skewnormal.fit(x)).T
        inside += (low <= truth) & (truth <= high)
    mean, sd, third = (inside / replications).tolist()
    return {"n": n, "skewness": skewness, "mean": mean, "sd": sd, "skewness_coverage": third}


def likelihood_ratio(x: NDArray[np.float64], skewness: float) -> float:
    """Likelihood ratio of a skewness; the largest stands for the half-normal limit."""
    y, share = likelihood.standardised(x)[0], skewness / skewnormal.MAX_SKEWNESS
    v = float(np.arctanh(share)) if share < 1.0 else np.inf
    return profile._Profile(y, float(y.size), skewnormal.fit(y).cp).of_skewness(v)


def critical(n: int, skewness: float, replications: int) -> float:
    """95 % quantile of the likelihood ratio of a true skewness over that of chi square."""
    rng = np.random.default_rng([4, n, round(1000 * skewness)])
    ratios = [likelihood_ratio(of_skewness(skewness, n, rng), skewness) for _ in range(replications)]
    return float(np.quantile(ratios, 0.95) / chi2.ppf(0.95, 1))


def compare(n_samples: int) -> dict[str, float]:
    """Fit random samples in both ways."""
    rng = np.random.default_rng(1)
    failures, worst, better = 0, 0.0, 0
    for k in range(n_samples):
        x = sample(rng, int(np.exp(rng.uniform(np.log(50.0), np.log(5000.0)))))
        ours = skewnormal.fit(x)
        theirs = scipy_fit(x)
        deficit = float(skewnorm.logpdf(x, theirs[2], theirs[0], theirs[1]).mean())
        deficit -= skewnormal.log_likelihood(x, ours.dp) / x.size
        worst = max(worst, deficit)
        better += deficit < -DEFICIT
        if not np.isfinite(ours.dp).all() or not deficit <= DEFICIT:
            failures += 1
            print(f"sample {k}: n = {x.size}, skewness {ours.cp[2]:.4f}, {deficit:.1e} below scipy")
    seconds: dict[str, list[float]] = {"ours": [], "scipy": []}
    for _ in range(40):
        x = sample(rng, 1000)
        for name, function in (("ours", skewnormal.fit), ("scipy", scipy_fit)):
            start = time.perf_counter()
            function(x)
            seconds[name].append(time.perf_counter() - start)
    ms = {name: 1000.0 * float(np.median(values)) for name, values in seconds.items()}
    print(f"{n_samples} samples: {failures} failures, worst {worst:.1e} below scipy; scipy worse in {better}")
    print(f"at n = 1,000: ours {ms['ours']:.2f} ms, scipy {ms['scipy']:.2f} ms ({ms['scipy'] / ms['ours']:.0f}x)")
    return {"failures": failures, "n": n_samples, "ms": ms["ours"], "scipy_ms": ms["scipy"]}


def main() -> None:
    """Print what failed, the times, the coverage and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="300 samples in place of 10,000, 3 cells of coverage")
    parser.add_argument("--critical", action="store_true", help="simulate the table of critical values")
    options = parser.parse_args()
    with one_thread():
        if options.critical:
            for n in CRITICAL_SIZES[: 1 if options.quick else None]:
                row = [critical(n, skewness, 50 if options.quick else 2000) for skewness in CRITICAL_SKEWNESSES]
                print(f"n = {n}: {', '.join(f'{value:.3f}' for value in row)}", flush=True)
            return
        summary = compare(300 if options.quick else 10_000)
        cells = [(100, 0.3), (100, 0.9), (1000, 0.6)] if options.quick else list(product(SIZES, SKEWNESSES))
        replications = 100 if options.quick else 1000
        print(f"share of {replications} samples whose 95 % intervals hold the truth [%]")
        print("    n  skewness   mean     sd  skewness")
        table = []
        for n, skewness in cells:
            table.append(coverage(n, skewness, replications))
            shares = [100.0 * table[-1][key] for key in ("mean", "sd", "skewness_coverage")]
            print(f"{n:5d}  {skewness:8.2f}  {shares[0]:5.1f}  {shares[1]:5.1f}     {shares[2]:5.1f}", flush=True)
    print(json.dumps({**summary, "coverage": table}))


if __name__ == "__main__":
    main()

"""Comparison of radcal's skew-normal fit with scipy's, on random samples of all skewnesses and many sizes.

    python benchmarks/skewnormal_fit.py [--quick]

The samples have n = 50 to 5,000 values (log-uniform). Mean, standard deviation and skewness of the densities are drawn
uniformly, the skewness over nearly its whole range. A failure is a result that is not finite, or a mean log-likelihood
that is more than 1e-6 below that of ``scipy.stats.skewnorm.fit``, started from its own default. Times are medians for
1,000 values.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings

import numpy as np
from numpy.typing import NDArray
from scipy.stats import skewnorm

from radcal import skewnormal
from radcal.processes import one_thread

DEFICIT = 1e-6


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
    """Print what failed, the times and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="300 samples in place of 10,000")
    options = parser.parse_args()
    with one_thread():
        print(json.dumps(compare(300 if options.quick else 10_000)))


if __name__ == "__main__":
    main()

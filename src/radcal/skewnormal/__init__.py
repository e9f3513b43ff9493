"""The skew-normal distribution: density, parametrisations, maximum likelihood, distances.

Direct parameters (DP) are (xi, omega, alpha), centred parameters (CP) are (mean, standard
deviation, skewness). All values are backscatter in dB, so xi, omega, mean and sd are in dB.

References
----------
Azzalini, "A class of distributions which includes the normal ones", Scand. J. Statist. 12
(1985). Azzalini and Capitanio, "The Skew-Normal and Related Families" (2014), sections 2.1
(density), 3.1 (likelihood, centred parametrisation).
"""

from __future__ import annotations

from radcal.skewnormal.distances import density_rms, hellinger, kolmogorov_smirnov, target_grid
from radcal.skewnormal.distribution import MAX_SKEWNESS, cdf, centred, density, direct, log_likelihood, sample
from radcal.skewnormal.likelihood import Fit, covariance, fit

__all__ = [
    "MAX_SKEWNESS",
    "Fit",
    "cdf",
    "centred",
    "covariance",
    "density",
    "density_rms",
    "direct",
    "fit",
    "hellinger",
    "kolmogorov_smirnov",
    "log_likelihood",
    "sample",
    "target_grid",
]

"""Wrong variants of texture on simulated pixels, against the moments of the gamma distribution."""

import numpy as np
from scipy import stats
from variants import agrees

from radcal.simulators.runner import textured


def test_texture_multiplies_the_power_and_keeps_its_mean():
    order, level = 3.4, np.full(400_000, -12.0, np.float32)
    power = 10.0 ** (textured(level, order, 5, "grass").astype(np.float64) / 10.0) / 10.0**-1.2
    logarithm = np.log(power)
    agrees(
        [power.mean(), power.var(), stats.skew(logarithm)],
        [1.0, 1.0 / order, float(stats.loggamma.stats(order, moments="s"))],
        rtol=0.02,
        divided=[order / (order - 1.0), order**2 / ((order - 1.0) ** 2 * (order - 2.0)), 0.6],
        amplitude=[1.0, 0.25 / order, -0.3],
        sum_of_powers=[order, order, -0.6],
        log_normal=[1.0, 1.0 / order, 0.0],
    )

"""Wrong variants of what a law and its ground lead to expect in a bin, from sums over angles and scipy's moments."""

import numpy as np
from scipy import stats
from variants import agrees

from radcal.inference.misfit import expected_cumulants, law_cumulants
from radcal.laws import law_for

K = 10.0 / np.log(10.0)
NODES = np.array([[24.0, 27.0, 33.0], [38.0, 41.0, 52.0]])


def moments(levels):
    return np.stack([levels.mean(1), levels.var(1), stats.moment(levels, 3, axis=1)], axis=-1)


def test_law_over_the_angles_of_a_bin_with_noise_in_power():
    def curve(phi):
        return -19.0 + 6.0 * np.cos(phi) + 9.0 * np.exp(-3.0 * phi**2)

    phi, noise = np.radians(NODES), -14.0
    level = curve(phi)
    seen = 10.0 * np.log10(10.0 ** (level / 10.0) + 10.0 ** (noise / 10.0))
    power = 10.0 * np.log10((10.0 ** (seen / 10.0)).mean(1))
    right = moments(seen)
    agrees(
        law_cumulants(law_for("mangia"), [-19.0, 6.0, 9.0, 3.0], NODES, noise),
        right,
        no_noise=moments(level),
        degrees=moments(curve(NODES)),
        mean_of_power=np.column_stack([power, right[:, 1:]]),
        middle_of_bin=np.column_stack([seen[:, 1], right[:, 1:]]),
        sd=np.column_stack([right[:, 0], np.sqrt(right[:, 1]), right[:, 2]]),
        mirrored=right * [1.0, 1.0, -1.0],
        sample=right * [1.0, 1.5, 1.0],
    )


def test_looks_of_the_ground_change_all_three_cumulants():
    simulated = np.array([[-9.0, 8.0, -11.0], [-12.0, 9.5, -14.0]])

    def speckle(looks):
        mean, variance, skewness = (float(x) for x in stats.loggamma.stats(looks, moments="mvs"))
        return np.array([K * (mean - np.log(looks)), K**2 * variance, K**3 * skewness * variance**1.5])

    change, fields = speckle(2.6) - speckle(4.0), np.array([0.0, 1.0, 0.0])
    right = simulated + change + 0.7 * fields
    agrees(
        expected_cumulants(simulated, 4.0, 2.6, 0.7),
        right,
        backwards=simulated - change + 0.7 * fields,
        variance_alone=simulated + (change + 0.7) * fields,
        sd_of_fields=simulated + change + 0.49 * fields,
        no_fields=simulated + change,
        ratio_of_looks=simulated * [1.0, 4.0 / 2.6, 1.0] + 0.7 * fields,
        ratio_of_means=simulated + [10.0 * np.log10(2.6 / 4.0), change[1] + 0.7, change[2]],
    )

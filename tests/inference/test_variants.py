"""Wrong variants of what a law and its ground lead to expect in a bin, from sums over angles and scipy's moments."""

import numpy as np
from scipy import stats
from variants import agrees

from radcal.inference.incidence_error import attenuation, registration_error_deg, true_nodes
from radcal.inference.misfit import expected_cumulants, law_cumulants
from radcal.inference.moments import from_cumulants, sampling_covariance
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
    agrees(
        from_cumulants(right),
        np.column_stack([right[:, 0], np.log(np.sqrt(right[:, 1])), right[:, 2] / right[:, 1] ** 1.5]),
        log_variance=np.column_stack([right[:, 0], np.log(right[:, 1]), right[:, 2] / right[:, 1] ** 1.5]),
        third=np.column_stack([right[:, 0], 0.5 * np.log(right[:, 1]), right[:, 2]]),
        sign=np.column_stack([right[:, 0], 0.5 * np.log(right[:, 1]), -right[:, 2] / right[:, 1] ** 1.5]),
    )


def test_errors_of_mean_and_log_sd():
    """Of n log-gamma values: s^2 / n, (excess kurtosis + 2) / 4n, and their covariance by the skewness."""
    looks, n = 3.0, 250.0
    variance = K**2 * stats.loggamma.var(looks)
    skewness, excess = (float(x) for x in stats.loggamma.stats(looks, moments="sk"))
    found = sampling_covariance(variance, n)[:2, :2]
    off = 0.5 * np.sqrt(variance) * skewness / n
    right = np.array([[variance / n, off], [off, (excess + 2.0) / (4.0 * n)]])
    agrees(
        found,
        right,
        rtol=1e-5,
        normal=[[variance / n, 0.0], [0.0, 0.5 / n]],
        errors=np.sqrt(np.abs(right)),
        bright_tail=right * [[1.0, -1.0], [-1.0, 1.0]],
        kurtosis=[[variance / n, off], [off, (excess + 5.0) / (4.0 * n)]],
        of_variance=[[variance / n, 2.0 * off], [2.0 * off, (excess + 2.0) / n]],
        sum_of_values=right * n**2,
    )


def test_errors_of_the_incidence():
    angle, error = np.array([28.0, 33.0, 41.0, 44.0, 57.0]), 3.0
    share = (angle.var() - error**2) / angle.var()
    agrees(
        attenuation(angle, error),
        share,
        standard_errors=(angle.std() - error) / angle.std(),
        mapped_for_true=angle.var() / (angle.var() + error**2),
        none=1.0,
        slope_squared=share**2,
    )
    nodes = true_nodes(NODES, error, 39.0, 0.8).reshape(2, 3, 5)
    right = np.stack([39.0 + 0.8 * (NODES - 39.0), np.full((2, 3), error * np.sqrt(0.8))])
    agrees(
        [nodes.mean(-1), nodes.std(-1)],
        right,
        not_drawn=[NODES, right[1]],
        to_zero=[0.8 * NODES, right[1]],
        whole_error=[right[0], np.full((2, 3), error)],
        share_of_error=[right[0], np.full((2, 3), error * 0.8)],
        spread=[39.0 + (NODES - 39.0) / 0.8, right[1]],
    )
    row, column = np.mgrid[0:9, 0:7]
    tilted = (30.0 + 2.0 * row - 0.9 * column).astype(np.float32)
    slope, uncertain = np.hypot(2.0, 0.9), np.full((9, 7), 0.6, np.float32)
    agrees(
        registration_error_deg(tilted, uncertain, np.array([24, 31])),
        np.full(2, slope * 0.6 / np.sqrt(2.0)),
        along_gradient=np.full(2, slope * 0.6),
        rows=np.full(2, 2.0 * 0.6 / np.sqrt(2.0)),
        variance=np.full(2, 0.5 * (slope * 0.6) ** 2),
        sum_of_slopes=np.full(2, 2.9 * 0.6 / np.sqrt(2.0)),
    )

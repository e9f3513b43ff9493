"""Wrong variants of speckle and texture, against scipy.stats and the definitions of the impulse response."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import polygamma
from variants import agrees

from radcal.speckle.response import impulse_response, speckle_correlation
from radcal.speckle.texture import equal_texture, log_speckle_cumulants, order_of_texture, texture_order

K = 10.0 / np.log(10.0)


@pytest.mark.parametrize("looks", [1.4, 2.7, 9.0])
def test_cumulants_of_speckle_in_decibels(looks):
    mean, variance, skewness = (float(x) for x in stats.loggamma.stats(looks, moments="mvs"))
    third = skewness * variance**1.5
    right = [K * (mean - np.log(looks)), K**2 * variance, K**3 * third]
    agrees(
        log_speckle_cumulants(looks),
        right,
        mean_of_decibels=[0.0, *right[1:]],
        sum_of_looks=[K * mean, *right[1:]],
        nepers=[mean - np.log(looks), variance, third],
        amplitude=np.array(right) * [2.0, 4.0, 8.0],
        bright_tail=[right[0], right[1], -right[2]],
        standard_deviation=[right[0], np.sqrt(right[1]), right[2]],
        skewness=[right[0], right[1], skewness],
        of_one_look=[K * stats.loggamma.mean(1.3), K**2 * 5.0, right[2]],
    )


def test_texture_adds_to_the_variance_in_decibels():
    looks, effective, others = 4.0, 2.5, 7.0
    order = texture_order(looks, effective)
    speckle, whole = stats.loggamma.var(looks), stats.loggamma.var(effective)
    of_intensity = (1.0 + 1.0 / looks) / ((1.0 + 1.0 / effective) - (1.0 + 1.0 / looks))
    agrees(
        stats.loggamma.var(order),
        whole - speckle,
        intensity=stats.loggamma.var(of_intensity),
        whole=whole,
        looks_apart=stats.loggamma.var(looks - effective),
    )
    found = equal_texture(looks, effective, others)
    agrees(
        stats.loggamma.var(found),
        stats.loggamma.var(others) + whole - speckle,
        unchanged=whole,
        share=stats.loggamma.var(effective * others / looks),
        less=stats.loggamma.var(others),
    )
    order = order_of_texture(2.2)
    agrees(K * np.sqrt(polygamma(1, order)), 2.2, nepers=2.2 * K, variance=np.sqrt(2.2), amplitude=1.1)


@pytest.mark.parametrize(("resolution", "spacing"), [(2.0, 1.1), (3.7, 0.9)])
def test_response_has_its_width_in_power_and_unit_energy(resolution, spacing):
    taps = impulse_response(resolution, spacing / 32.0)
    middle = taps.size // 2
    db = 10.0 * np.log10((taps[middle:] / taps[middle]) ** 2 + 1e-30)
    half = np.interp(10.0 * np.log10(2.0), -db[:300], np.arange(300)) * spacing / 32.0
    agrees(
        2.0 * half,
        resolution,
        rtol=0.01,
        of_amplitude=resolution * 1.38,
        half=resolution / 2.0,
        unweighted=resolution / 1.3,
    )
    coarse = impulse_response(resolution, spacing)
    agrees(
        (coarse**2).sum(), 1.0, rtol=1e-9, unit_sum=(coarse**2).sum() / coarse.sum() ** 2, unit_peak=coarse.max() ** -2
    )


def test_correlation_of_power_is_the_square_of_that_of_amplitude():
    steps = 16
    taps = impulse_response(1.0, 1.0 / steps)
    lags = np.correlate(taps, taps, mode="full")[taps.size - 1 :]
    at = np.array([0.25, 0.5, 1.0])
    amplitude = lags[(at * steps).astype(int)] / lags[0]
    agrees(
        speckle_correlation(at),
        amplitude**2,
        rtol=6e-3,
        amplitude=amplitude,
        response=(taps[taps.size // 2 :][(at * steps).astype(int)] / taps.max()) ** 2,
        fourth_power=amplitude**4,
    )

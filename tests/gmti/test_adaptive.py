"""Clutter filters and Kelly's test, against closed forms."""

import numpy as np
import pytest
from scipy.stats import beta
from variants import agrees

from radcal.gmti.adaptive import (
    Interval,
    covariance,
    dpca,
    kelly,
    kelly_threshold,
    least_velocity_mps,
    sinr_loss_db,
)

# 100 m/s, 2 kHz, X band, receivers 2 v / PRF apart
ONE = Interval(3, 16, 0.1, 100.0, 2000.0, 0.0312)
SINE = np.linspace(-0.15, 0.15, 601)
BEAM = np.sinc(2.0 * 0.1 * SINE / 0.0312) ** 2  # two-way amplitude


def three_errors(found, p, count):
    assert found == pytest.approx(p, abs=3.0 * np.sqrt(p * (1.0 - p) / count))


@pytest.mark.parametrize(("off", "db"), [(0.001, -61.9), (0.01, -41.9), (0.03, -32.4)])
def test_dpca_leaves_the_mismatch_of_the_speed(off, db):
    """4 sin^2 of half the mismatch in phase, averaged over the two-way power of the beam."""
    fast = Interval(3, 16, 0.1, 100.0 * (1.0 + off), 2000.0, 0.0312)
    residual = np.mean(np.abs(dpca(fast.steering(SINE) * BEAM, fast)) ** 2) / np.mean(BEAM**2)
    mismatch = 2.0 * np.pi * SINE * (2.0 * fast.speed_mps / 2000.0 - 0.1) / 0.0312
    closed = 10.0 * np.log10(np.average(4.0 * np.sin(0.5 * mismatch) ** 2, weights=BEAM**2))
    assert closed == pytest.approx(db, abs=0.1)
    agrees(10.0 * np.log10(residual), closed, atol=0.05, amplitude=closed / 2.0, one_way=closed - 6.0)


def test_dpca_cancels_standing_ground_and_keeps_movers():
    assert np.abs(dpca(ONE.steering(SINE), ONE)).max() < 1e-12
    # a mover changes its phase by 4 pi v / (wavelength PRF) from pulse to pulse
    turned = 4.0 * np.pi * 6.0 / (0.0312 * 2000.0)
    np.testing.assert_allclose(np.abs(dpca(ONE.steering(0.05, 6.0), ONE)), 2.0 * np.sin(0.5 * turned), rtol=1e-9)


def known(ratio_db=40.0):
    return covariance(ONE, SINE, 10.0 ** (ratio_db / 10.0) * BEAM**2 / (BEAM**2).sum())


def test_sinr_loss_of_clutter_of_one_direction():
    """Clutter of power c from one direction: the part along it is divided by 1 + c D (Sherman and Morrison)."""
    one = covariance(ONE, np.array([0.0]), np.array([3.0]))
    at = ONE.steering([0.0, 0.02], [0.0, 4.0])
    along = np.abs(at.conj().T @ ONE.steering(0.0)[:, 0]) ** 2 / 48.0
    closed = 10.0 * np.log10((48.0 - along * 3.0 * 48.0 / (1.0 + 3.0 * 48.0)) / 48.0)
    agrees(sinr_loss_db(one, at), closed, atol=1e-9, amplitude=closed / 2.0, none=[0.0, 0.0])


def test_least_velocity():
    """The loss is 5 dB there, and less beyond."""
    found = least_velocity_mps(ONE, known())
    loss = sinr_loss_db(known(), ONE.steering(0.0, [found - 0.02, found + 0.02]))
    assert loss[0] < -5.0 < loss[1]
    assert least_velocity_mps(ONE, np.eye(48)) == 0.0
    assert np.isnan(least_velocity_mps(ONE, 1e3 * np.eye(48)))


SMALL = Interval(2, 4, 0.1, 100.0, 2000.0, 0.0312)  # 8 echoes: Kelly's test does not depend on their number otherwise
CLUTTER = covariance(SMALL, SINE, 1e4 * BEAM**2 / (BEAM**2).sum())


def trial(count, snr, velocity, training=16, seed=1):
    rng, root = np.random.default_rng(seed), np.linalg.cholesky(CLUTTER)

    def drawn(*shape):
        return root @ (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)

    target, found = SMALL.steering(0.0, velocity), []
    for _ in range(0, count, 5000):
        gates = drawn(5000, 8, training)
        amplitude = np.sqrt(snr / 2.0) * (rng.standard_normal(5000) + 1j * rng.standard_normal(5000))
        cells = drawn(5000, 8, 1) + amplitude[:, None, None] * target
        found.append(kelly(cells, gates @ gates.conj().swapaxes(1, 2), target).ravel())
    return np.concatenate(found)


def test_false_alarms_of_kellys_test():
    found = trial(100_000, 0.0, 6.0)
    for pfa in (1e-1, 1e-2, 1e-3):
        three_errors((found > kelly_threshold(pfa, 8, 16)).mean(), pfa, found.size)


@pytest.mark.parametrize(("velocity", "snr_db"), [(3.0, 14.0), (6.0, 6.0), (7.5, 12.0)])
def test_detections_of_kellys_test(velocity, snr_db):
    """Swerling 1: with the loss factor b of the sample covariance, beta(K - D + 2, D - 1), Pd is the mean of
    (1 + tau / (1 + snr b))^-(K - D + 1)."""
    snr, count = 10.0 ** (snr_db / 10.0), 20_000
    eta = kelly_threshold(1e-3, 8, 16)
    tau = eta / (1.0 - eta)
    output = snr * 8.0 * 10.0 ** (sinr_loss_db(CLUTTER, SMALL.steering(0.0, velocity))[0] / 10.0)
    lost = beta(16 - 8 + 2, 8 - 1).ppf((np.arange(4000) + 0.5) / 4000)
    closed = np.mean((1.0 + tau / (1.0 + output * lost)) ** -(16 - 8 + 1))
    assert 0.15 < closed < 0.95
    three_errors((trial(count, snr, velocity) > eta).mean(), closed, count)
    without_loss = (1.0 + tau / (1.0 + output)) ** -9
    assert abs(without_loss - closed) > 10.0 * np.sqrt(closed * (1.0 - closed) / count)

"""Error of the form of a law: its size, whether it is noticed, and the smallest one that would be noticed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.posterior.curves import NORMAL_90
from radcal.posterior.result import FormError

if TYPE_CHECKING:
    from radcal.posterior.calibrated import LawModel

Doubles = NDArray[np.float64]

_REFUTED_DB = 1.0
_POWER = 0.9  # share of images in which a bump is noticed
_PLACES, _WIDTHS = 5, (0.125, 0.25)  # angles of the bumps, and standard deviations in shares of the incidence seen
_SIZES_DB = (0.05, 32.0)
_RMS = 0.5  # of a bump of 1 dB over the incidence seen, about which the scale of the form error is
_STEP = 1e-3


def form_error(forms_db: Doubles, smallest_db: float) -> FormError:
    """Error of the form of a law, from draws over the incidence seen less their means, shape (m, k) [dB]."""
    rms = np.sqrt((forms_db**2).mean(axis=1))
    quantiles = np.quantile(rms, [0.05, 0.5, 0.95])
    low, high = np.quantile(forms_db, [0.05, 0.95], axis=0)
    return FormError(quantiles, bool(((low > 0.0) | (high < 0.0)).any()), bool(quantiles[0] > _REFUTED_DB), smallest_db)


def noticed_db(
    model: LawModel, at: Doubles, forms: Doubles, knots_deg: Doubles, seen_deg: tuple[float, float]
) -> float:
    """Smallest bump in the law that would be noticed in nine of ten images [dB], by the linearised model.

    Bumps are Gaussian, lie at five angles over the incidence seen, and have standard deviations of an eighth and a
    quarter of its range. The largest size over these bumps is returned.

    Parameters
    ----------
    model : LawModel
        Model of the material.
    at : ndarray, shape (dimension,)
        Point of the posterior about which the model is linear.
    forms : ndarray, shape (41, 8)
        Columns of the error of the form at 41 angles over the incidence seen.
    knots_deg : ndarray, shape (k,)
        Angles of the knots [deg].
    seen_deg : (float, float)
        5 and 95 % quantiles of the incidence [deg].

    References
    ----------
    Kennedy and O'Hagan, "Bayesian calibration of computer models", J. R. Statist. Soc. B 63 (2001): discrepancy between
    the best law of a form and the truth. Lehmann and Romano, "Testing Statistical Hypotheses", 3rd edition (2005),
    section 3.1: power of a test.
    """
    p, d = model.linear.shape[1], model.d
    gram, _ = model.table.at(at[None, -2], at[None, -3])
    steps = np.repeat(at[None, :d], 2 * d, axis=0) + np.concatenate([np.eye(d), -np.eye(d)]) * _STEP
    levels = model.law.levels(model.law.scaled(steps))
    slopes = ((levels[:d] - levels[d:]) / (2.0 * _STEP)).T
    # linear columns, and the law by its deviates
    full = np.zeros((gram.shape[1], p + d))
    full[:p, :p], full[p + 1 :, p:] = np.eye(p), slopes
    information = full.T @ gram[0] @ full
    centred = forms - forms.mean(axis=0)
    shapes = np.zeros((len(forms), p + d))
    first = model.first_form
    shapes[:, first : first + forms.shape[1]] = centred

    def power(size: float, bump: Doubles) -> float:
        prior = np.ones(p + d)
        prior[first : first + forms.shape[1]] = max(np.exp(2.0 * at[-1]), (_RMS * size) ** 2)
        covariance = np.linalg.inv(information + np.diag(1.0 / prior))
        found = shapes @ covariance @ (full.T @ gram[0][:, p + 1 :] @ bump) * size
        sd = np.sqrt(np.einsum("ij,jk,ik->i", shapes, covariance, shapes))
        noise = np.sqrt(np.einsum("ij,jk,ik->i", shapes, covariance @ information @ covariance, shapes))
        return float(scipy.special.ndtr((np.abs(found) - NORMAL_90 * sd) / np.maximum(noise, 1e-12)).max())

    worst = 0.0
    for share in _WIDTHS:
        for middle in np.linspace(*seen_deg, _PLACES):
            bump = np.exp(-0.5 * ((knots_deg - middle) / (share * (seen_deg[1] - seen_deg[0]))) ** 2)
            low, high = (power(size, bump) - _POWER for size in _SIZES_DB)
            if high < 0.0:
                return float("inf")
            worst = max(
                worst,
                _SIZES_DB[0]
                if low > 0.0
                else scipy.optimize.brentq(lambda x, b=bump: power(x, b) - _POWER, *_SIZES_DB, xtol=0.01),
            )
    return worst

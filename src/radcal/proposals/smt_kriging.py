"""Length scales of ordinary kriging, estimated by the library smt with its defaults, as in the paper."""

from __future__ import annotations

import contextlib
import io
import warnings

import numpy as np
from numpy.typing import NDArray

from radcal.errors import SurrogateError

_THETA0 = 1e-2  # smt's default start


def train_smt(
    x: NDArray[np.float64], y: NDArray[np.float64], noisy: bool = False
) -> tuple[NDArray[np.float64], float, str]:
    """Length scales for the kriging of one output, estimated by the library smt with its defaults.

    Parameters
    ----------
    x : ndarray, shape (k, d)
        Points of the unit box.
    y : ndarray, shape (k,)
        Output at the points.
    noisy : bool
        Whether outputs at equal points differ; smt then estimates a nugget, too, by Cobyla, its only optimiser for it.

    Returns
    -------
    scales : ndarray, shape (d,)
        Length scales, in widths of the box.
    nugget : float
        Ratio of the variance of the noise to the variance of the process.
    status : str
        ``failed`` if smt reports a failure or leaves all length scales at their start, otherwise ``trained``.

    Raises
    ------
    SurrogateError
        If smt cannot train a model, for example from fewer than two points.
    """
    from smt.surrogate_models import KRG  # imported late: smt loads all its surrogates, which takes a second

    noise = {"eval_noise": True, "hyper_opt": "Cobyla"} if noisy else {}
    model = KRG(print_global=False, theta0=[_THETA0], **noise)
    printed = io.StringIO()
    with warnings.catch_warnings(), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        warnings.simplefilter("ignore")
        try:
            model.set_training_values(x, y[:, None])
            model.train()
        except Exception as error:
            raise SurrogateError(f"smt could not train on {len(x)} points ({error}).") from None
    theta = np.asarray(model.optimal_theta, dtype=np.float64).ravel()
    failed = "failed" in printed.getvalue() or np.allclose(theta, _THETA0)
    nugget = float(np.ravel(model.optimal_noise)[0]) if noisy else float(model.options["nugget"])
    # smt divides the points by their standard deviations and writes exp(-theta d^2)
    return x.std(axis=0, ddof=1) / np.sqrt(2.0 * theta), nugget, "failed" if failed else "trained"

"""Length scales of ordinary kriging chosen by smt with its defaults, as the paper did."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import SurrogateError

__all__ = ["smt_krg", "train_smt"]

_THETA0 = 1e-2  # smt's default start


@cache
def _krg_class() -> Any:
    """Kriging class of smt, imported without smt's other surrogates.

    The package itself imports every surrogate, and with one of them matplotlib, a third of the whole. While the
    module of kriging is imported, an empty package stands in its place.
    """
    name = "smt.surrogate_models"
    if name in sys.modules:
        return import_module(name).KRG
    spec = find_spec(name)
    if spec is None:
        raise ImportError(f"No module named {name!r}", name=name)
    sys.modules[name] = module_from_spec(spec)
    try:
        return import_module(f"{name}.krg").KRG
    finally:
        del sys.modules[name]


def smt_krg(options: Mapping[str, Any]) -> tuple[Any, list[Any]]:
    """Return an smt KRG that keeps what its optimiser reports, and that list."""
    statuses: list[Any] = []

    class Watched(_krg_class()):  # type: ignore[misc]
        def _create_optimizer(self) -> Any:
            optimizer = super()._create_optimizer()
            inner = optimizer._minimize

            def watched(*args: Any, **kwargs: Any) -> Any:
                result = inner(*args, **kwargs)
                statuses.append(result)
                return result

            optimizer._minimize = watched
            return optimizer

    return Watched(print_global=False, **options), statuses


def train_smt(
    x: NDArray[np.float64], y: NDArray[np.float64], noisy: bool = False
) -> tuple[NDArray[np.float64], float, str]:
    """Length scales of one output by smt with its defaults.

    Parameters
    ----------
    x : ndarray, shape (k, d)
        Points of the unit box.
    y : ndarray, shape (k,)
        Output at the points.
    noisy : bool
        Whether equal points have unequal outputs: smt then estimates a nugget, by Cobyla, its only optimiser for that.

    Returns
    -------
    scales : ndarray, shape (d,)
        Length scales, in widths of the box.
    nugget : float
        Variance of the noise over that of the process.
    status : str
        End of the optimiser: converged, evaluations used up (smt grants few, which is its normal end) or failed.

    Raises
    ------
    SurrogateError
        smt has no model, for example because there are fewer than two points.
    """
    noise = {"eval_noise": True, "hyper_opt": "Cobyla"} if noisy else {}
    model, statuses = smt_krg({"theta0": [_THETA0], **noise})
    printed = io.StringIO()
    with warnings.catch_warnings(), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        warnings.simplefilter("ignore")
        try:
            model.set_training_values(x, y[:, None])
            model.train()
        except Exception as error:
            raise SurrogateError(f"smt could not train on {len(x)} points ({error}).") from None
    theta = np.asarray(model.optimal_theta, dtype=np.float64).ravel()
    if "failed" in printed.getvalue() or not any(np.isfinite(s.fun) for s in statuses):
        status = "failed"
    else:
        best = min(statuses, key=lambda s: float(np.asarray(s.fun).ravel()[0]))
        status = "converged" if best.success else "evaluations used up"
        if not best.success and np.allclose(theta, _THETA0):
            status = "failed"
    nugget = float(np.ravel(model.optimal_noise)[0]) if noisy else float(model.options["nugget"])
    # smt divides the points by their standard deviations and writes exp(-theta d^2)
    return x.std(axis=0, ddof=1) / np.sqrt(2.0 * theta), nugget, status

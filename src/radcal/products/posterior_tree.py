"""Posterior of the laws in the groups and dimensions that ArviZ reads."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import StoreError
from radcal.laws import Law
from radcal.posterior.curves import PER_DEG
from radcal.posterior.result import WHOLE_DEG, LevelPoints, Posterior
from radcal.results.archive import Archive

if TYPE_CHECKING:
    import xarray

_SAMPLE = ("chain", "draw")


def posterior_tree(archive: Archive) -> xarray.DataTree:
    """Groups ``posterior``, ``prior``, ``sample_stats`` and ``observed_data`` of all calibrated laws.

    All variables have the dimension ``material``; what a material lacks, as a parameter of another law, is NaN. Each
    material has a posterior of its own: its draws are not joint with those of another one. One chain holds the draws,
    which are taken evenly from all walkers of the sampler; ``sample_stats`` has R-hat and effective sample size of the
    whole sample.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.

    Raises
    ------
    StoreError
        No posterior has draws.
    """
    import xarray

    case = archive.configured
    each = {name: one.posterior for name, one in archive.materials.items()}
    sampled = {name: one for name, one in each.items() if one.draws is not None}
    if not sampled:
        raise StoreError(f"{case.case}: no posterior has draws, expected those of a calibrated material.")
    names = {name: case.materials[name].parameter_names for name in sampled}
    priors = {name: archive.materials[name].prior for name in sampled}
    groups = {
        "posterior": {name: _posterior(one, case.laws[name], names[name]) for name, one in sampled.items()},
        "prior": {name: _draws(x, names[name]) for name, x in priors.items()},
        "sample_stats": {name: _sampler(one) for name, one in sampled.items()},
        "observed_data": {name: _levels(one.points) for name, one in sampled.items() if one.points is not None},
    }
    found = {
        group: xarray.concat(list(of.values()), xarray.Variable("material", list(of)), data_vars="all", join="outer")
        for group, of in groups.items()
        if of
    }
    found |= {group: found[group].transpose(*_SAMPLE, ...) for group in ("posterior", "prior") if group in found}
    tree = xarray.DataTree.from_dict(found)
    tree.attrs = {"case": case.case, "inference_library": "emcee", "radcal": json.loads(archive.versions)["radcal"]}
    return tree


def _draws(x: NDArray[np.float64], names: tuple[str, ...], **more: Any) -> xarray.Dataset:
    """Draws of X, shape (m, d), by the names of the parameters."""
    import xarray

    columns = {name: (_SAMPLE, column[None]) for name, column in zip(names, x.T, strict=True)}
    return xarray.Dataset({**columns, **more}, {"chain": [0], "draw": np.arange(len(x))})


def _posterior(found: Posterior, law: Law, names: tuple[str, ...]) -> xarray.Dataset:
    """Draws of X and of the standard deviations of fields and cells, and sigma0 at whole degrees of incidence."""
    draws = found.draws
    assert draws is not None  # noqa: S101
    effects = {key: (_SAMPLE, getattr(draws, key)[None], {"units": "dB"}) for key in ("field_db", "cell_db")}
    whole = _draws(draws.parameters, names, **effects)
    if found.curve is None:
        return whole
    curves = (*_SAMPLE, "incidence_deg"), draws.curves_db(law)[None, :, ::PER_DEG], {"units": "dB"}
    return whole.assign_coords(incidence_deg=WHOLE_DEG).assign(sigma0_db=curves)


def _sampler(found: Posterior) -> xarray.Dataset:
    """Measures of the convergence of the sampler."""
    import xarray

    values = {"r_hat": found.r_hat, "ess": found.ess, "steps": found.steps, "converged": int(found.sampled)}
    return xarray.Dataset({name: ((), value) for name, value in values.items()})


def _levels(points: LevelPoints) -> xarray.Dataset:
    """Measured levels with their standard errors, by interval of incidence."""
    import xarray

    columns = {name: ("interval", getattr(points, name)) for name in ("incidence_deg", "level_db", "error_db")}
    return xarray.Dataset(columns, {"interval": np.arange(points.level_db.size)})

"""Check of the scale that is declared for the images of an external simulator, against the measured image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.config import CommandSimulation
from radcal.config.part import Part
from radcal.errors import SimulatorError
from radcal.speckle.texture import log_speckle_cumulants

_HIGHEST_DB = 3.0  # speckle has an sd of 2 dB or more, so that an image with a lower median has negative values
_ROWS = 4  # distance at which the speckle of two pixels is nearly independent, and the ground mostly the same
_MOST_OF_SPECKLE = 0.8  # least share of the standard deviation of the speckle in the logarithm of power


def check_scale(simulated_db: NDArray[np.float32], measured_db: NDArray[np.float32], case: Part) -> None:
    """Refuse the reference run of an external simulator whose scale is db, but whose numbers are power or amplitude.

    The image is refused if none of its values is negative, the median of the measured image is negative, and the values
    cannot be dB: their median is below 3, or the logarithms of pixels four rows apart differ as those of speckle do.
    Values in dB at a high level, to which a poor start can lead, vary far less in relation to their mean.

    Parameters
    ----------
    simulated_db, measured_db : ndarray, shape (rows, columns)
        Image of the reference run, and measured image [dB]; NaN where a pixel has no value.
    case : Part
        Simulator and looks.

    Raises
    ------
    SimulatorError
        The values are not in dB.
    """
    if not isinstance(case.simulator, CommandSimulation) or case.simulator.output.scale != "db":
        return
    values = simulated_db[np.isfinite(simulated_db)]
    measured = float(np.nanmedian(measured_db))
    if not (values > 0.0).any() or values.min() < 0.0 or not measured < 0.0:
        return
    with np.errstate(divide="ignore", invalid="ignore"):
        as_power_db = 10.0 * np.log10(simulated_db.astype(np.float64))
        apart = as_power_db[_ROWS:] - as_power_db[:-_ROWS]
    spread_db = 1.4826 * float(np.median(np.abs(apart[np.isfinite(apart)]))) / np.sqrt(2.0)  # of a normal distribution
    speckle_db = np.sqrt(log_speckle_cumulants(float(case.radar.looks))[1])
    if np.median(values) >= _HIGHEST_DB and spread_db < _MOST_OF_SPECKLE * speckle_db:
        return
    middle = float(10.0 * np.log10(np.median(values[values > 0.0])))
    scale = "power" if abs(middle - measured) <= abs(2.0 * middle - measured) else "amplitude"
    raise SimulatorError(
        f"simulator.output.scale is db, but the values of the reference run's image run from {values.min():.3g} to "
        f"{values.max():.3g} with median {np.median(values):.3g}, none negative, while the measured image has a median "
        f"of {measured:.3g} dB. As power their median would be {middle:.3g} dB, as amplitude {2.0 * middle:.3g} dB: "
        f"set simulator.output.scale: {scale}?"
    )

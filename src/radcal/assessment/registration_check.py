"""Check of the registration with the image of the calibrated laws in place of the run onto which it was made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.findings import Finding, Severity
from radcal.laws import Law
from radcal.radar.geometry import Geometry
from radcal.registration.gefolki import find_flow, pyramid
from radcal.registration.registered import Registered
from radcal.targets.target import Target

_TIMES = 1.5  # least ratio of a change to its stated standard error
_LEAST_DB = 0.5  # least change of sigma0 that a doubt names, as for a misfit
_FAR_PX = 3.0  # mean displacement from which the search starts at this displacement


def moved_finding(name: str, moved_px: float, stated_px: float, moved_db: float, stated_db: float) -> Finding:
    """Finding on the registration of one material's pixels.

    A warning if displacement and sigma0 change more than their stated errors explain, and sigma0 by over 0.5 dB.

    Parameters
    ----------
    name : str
        Material.
    moved_px, stated_px : float
        Root mean square change of the displacement of the material's pixels, and root mean square of the standard
        error of its length that the registration stated [pixels].
    moved_db, stated_db : float
        Root mean square change of sigma0 of these pixels by the calibrated law, to first order, and its stated standard
        error [dB].
    """
    doubtful = moved_px > _TIMES * stated_px and moved_db > max(_TIMES * stated_db, _LEAST_DB)
    numbers = {"moved_px": moved_px, "stated_px": stated_px, "moved_db": moved_db, "stated_db": stated_db}
    severity: Severity = "warning" if doubtful else "note"
    return Finding("registration_moved", severity, name, numbers, f"materials.{name}.start" * doubtful)


def moved_again(registered: Registered, calibrated_db: NDArray[np.float32]) -> NDArray[np.float64]:
    """Change of the displacement field if the image is registered onto another simulated image.

    Parameters
    ----------
    registered : Registered
        Registered measured image, with its displacement.
    calibrated_db : ndarray, shape (rows, columns)
        Simulated image of the calibrated laws [dB].

    Returns
    -------
    ndarray, shape (2, rows, columns)
        New displacement minus present displacement [pixels].
    """
    present = registered.displacement_px.astype(np.float64)
    mean = present.mean(axis=(1, 2))
    start = mean if np.hypot(*mean) > _FAR_PX else None
    return find_flow(pyramid(calibrated_db, registered.unregistered_db), start=start).displacement_px - present


def check_registration(
    laws: Mapping[str, tuple[Law, ArrayLike]],
    targets: Mapping[str, Target],
    geometry: Geometry,
    registered: Registered,
    calibrated_db: NDArray[np.float32],
) -> Iterator[Finding]:
    """Register the measured image again, onto the image of the calibrated laws, and compare both registrations.

    The registration compares patterns of brightness. If the laws of the run onto which the image was registered differ
    much from the real laws, other slopes are bright in this run than in the measured image, and the displacement has an
    error that its standard error does not contain. The image of the calibrated laws has the right pattern if the laws
    are right. If the displacement then changes by more than its standard error, one of the two registrations is wrong.

    Parameters
    ----------
    laws : mapping
        Calibrated law of each material, and its parameters.
    targets : mapping
        Target of each material in this pass.
    geometry : Geometry
        Geometry of the pass.
    registered : Registered
        Registered measured image.
    calibrated_db : ndarray, shape (rows, columns)
        Simulated image of the calibrated laws [dB].

    Yields
    ------
    Finding
        Change of each material that has a law with a curve; none if the image was not moved.
    """
    if not registered.applied or registered.method != "gefolki":
        return
    change = moved_again(registered, calibrated_db)
    incidence = geometry.incidence_deg.astype(np.float64)
    down, right = np.gradient(incidence)
    gradient = np.stack([down, right])
    for name, (law, parameters) in laws.items():
        if name not in targets or not law.has_curve:
            continue
        pixels = targets[name].pixels
        moved, stated = change.reshape(2, -1)[:, pixels], registered.uncertainty_px.ravel()[pixels].astype(np.float64)
        steep = gradient.reshape(2, -1)[:, pixels]
        angle = np.radians(incidence.ravel()[pixels])
        slope = np.asarray(law(angle + 1e-4, parameters) - law(angle - 1e-4, parameters)) / np.degrees(2e-4)
        # an unknown direction of the error: half of its square lies along the gradient
        changes = np.stack([slope * (steep * moved).sum(axis=0), slope * np.hypot(*steep) * stated / np.sqrt(2.0)])
        moved_db, stated_db = _rms(changes[:, np.isfinite(changes).all(axis=0)])
        yield moved_finding(name, *map(float, (_rms(np.hypot(*moved)), _rms(stated), moved_db, stated_db)))


def _rms(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square along the last axis; 0 for no values."""
    return np.sqrt(np.mean(np.square(values), axis=-1)) if values.shape[-1] else np.zeros(values.shape[:-1])

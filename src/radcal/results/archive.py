"""Archive of all results of a calibration, ``calibration.h5``; the classes of this module define its layout.

Of the units "dB or IQR", ``levels.unit`` says which of the two applies.
``python -m radcal.results.archive`` prints the layout as a table, which ``docs/archive.md`` contains.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.stopping import Decision
from radcal.config import Case
from radcal.errors import StoreError
from radcal.findings import Finding
from radcal.ground.levels import Levels, without_level
from radcal.posterior.result import Image, Posterior
from radcal.registration.registered import Registered
from radcal.sections.objectives import OBJECTIVES
from radcal.storage.dataclass_groups import table
from radcal.storage.records import Stored
from radcal.targets.target import Target

UNLISTED = (Registered, Target)
"""Classes whose fields the table of the layout does not list."""

Bytes = NDArray[np.uint8]
Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Runs:
    """All n runs of a calibration, in the order reference, reused, design, infill.

    Attributes
    ----------
    kind : ndarray of str, shape (n,)
        Reference, registration, reused, design or infill.
    index : ndarray of int64, shape (n,)
        Number of the run within its kind.
    seconds : ndarray of float64, shape (n,)
        Wall time of the simulator [s].
    """

    kind: NDArray[np.str_]
    index: Integers
    seconds: Doubles


@dataclass(frozen=True)
class Fidelity:
    """Proposals of the surrogate for each infill run, and statistics of the run; NaN without a prediction.

    Attributes
    ----------
    mode : tuple of str, shape (m,)
        Mode of each proposal: exploit, explore, exhausted or ended.
    cost : ndarray of float64, shape (m,)
        Cost that the surrogate predicted.
    floor : ndarray of float64, shape (m,)
        Smallest cost that the surrogate allows within two standard errors; NaN if unknown.
    predicted : ndarray of float64, shape (m, b, 3)
        Predicted mean, log sd and skewness of each incidence-angle bin [dB or IQR].
    error : ndarray of float64, shape (m, b, 3)
        Kriging standard deviation of each predicted statistic [dB or IQR].
    verified : ndarray of float64, shape (m, b, 3)
        Mean, log sd and skewness of each incidence-angle bin in the run [dB or IQR].
    q2 : ndarray of float64, shape (m, 3)
        Leave-one-out Q2 of the surrogate, by statistic.
    """

    mode: tuple[str, ...]
    cost: Doubles
    floor: Doubles
    predicted: Doubles
    error: Doubles
    verified: Doubles
    q2: Doubles


@dataclass(frozen=True)
class SearchFront:
    """Front of NSGA-II in the last search for a material: f points with p objectives, and the objectives of n runs.

    Attributes
    ----------
    objectives : tuple of str
        Names of the sums of squared residuals that NSGA-II minimises as objectives.
    predicted : ndarray of float64, shape (f, p)
        Objectives of the points of the front, predicted by the last surrogate.
    verified : ndarray of float64, shape (n, p)
        Objectives of each run; NaN for a run with another law.
    """

    objectives: tuple[str, ...]
    predicted: Doubles
    verified: Doubles


@dataclass(frozen=True)
class BinStatistics:
    """Mean, log sd and skewness of the b incidence-angle bins of one material, the bins of all passes in order.

    Attributes
    ----------
    in_pass : ndarray of int64, shape (b,)
        Number of the pass of each bin, from 1.
    incidence_deg : ndarray of float64, shape (b,)
        Mean local incidence of each bin [deg].
    measured : ndarray of float64, shape (b, 3)
        Statistics of the measured pixels [dB, 1, 1].
    error : ndarray of float64, shape (b, 3)
        Standard deviation of simulated minus measured by speckle, cells and fields [dB, 1, 1].
    calibrated : ndarray of float64, shape (b, 3)
        Statistics expected of the best run, at its effective looks and with fields [dB, 1, 1].
    start : ndarray of float64 or None, shape (b, 3)
        The same of the reference run; absent if it has another law [dB, 1, 1].
    sensitivity : ndarray of float64 or None, shape (b, 3, d)
        Change of a simulated statistic, by the surrogate, over 1 % of each bound's width [dB, 1, 1].
    """

    in_pass: NDArray[np.int64]
    incidence_deg: Doubles
    measured: Doubles
    error: Doubles
    calibrated: Doubles
    start: Doubles | None = None
    sensitivity: Doubles | None = None


@dataclass(frozen=True)
class MaterialResult:
    """Target and results of one calibrated material: d parameters, n runs, m infill runs, p pixels of the target.

    Attributes
    ----------
    targets : mapping of str to Target
        Target density and its measured pixels, by the number of the pass that shows it.
    rms_final, rms_fresh : float
        Rms difference of the density of the final run with the common random numbers, and of that with fresh ones, from
        the target's [1/dB or 1/IQR]; the second is NaN if both runs have equal pixels.
    textured : bool
        Material has far fewer looks than the image's homogeneous areas.
    level_only : bool
        Material is seen at one incidence: only its level can be determined.
    best : int
        Best run, an index into ``runs``.
    parameters : ndarray of float64, shape (n, d)
        X of each run; NaN for a run with another law.
    dp : ndarray of float64, shape (n, 3)
        xi, omega and alpha (no unit) of each run's density [dB or IQR].
    rms : ndarray of float64, shape (n,)
        Rms difference of each run's density from the target's [1/dB or 1/IQR].
    cost : ndarray of float64, shape (n,)
        Quantity that the search minimises: half the sum of squared residuals of bins, or the rms.
    looks : ndarray of float64, shape (n,)
        Effective number of looks at which each run fits the target best.
    posterior : Posterior
        Posterior of the law.
    prior : ndarray of float64, shape (2000, d)
        Draws of X from the prior of the posterior.
    hidden : ndarray of float64 or None, shape (d,)
        True X of a synthetic measurement.
    fidelity : Fidelity or None
        Proposals of the surrogate and the runs that verified them.
    front : SearchFront or None
        Front of the last search, if it had several objectives.
    bins : BinStatistics or None
        Statistics of incidence-angle bins; absent without bins.
    """

    targets: Mapping[str, Target]
    rms_final: float
    rms_fresh: float
    textured: bool
    level_only: bool
    best: int
    parameters: Doubles
    dp: Doubles
    rms: Doubles
    cost: Doubles
    looks: Doubles
    posterior: Posterior
    prior: Doubles
    hidden: Doubles | None = None
    fidelity: Fidelity | None = None
    front: SearchFront | None = None
    bins: BinStatistics | None = None

    @property
    def target(self) -> Target:
        """Target density and its measured pixels in the first pass."""
        return self.targets["1"]

    @property
    def fits(self) -> bool | None:
        """Whether the form of the law is not refuted; None where it cannot be told."""
        return None if self.posterior.form is None else not self.posterior.form.refuted


@dataclass(frozen=True)
class Images:
    """Whole images, with rows along slant range and columns along azimuth; None for an image that is not archived.

    Attributes
    ----------
    reference_db : ndarray of float32 or None, shape (rows, columns)
        Reference run [dB].
    calibrated_db : ndarray of float32 or None, shape (rows, columns)
        Calibrated run with another seed [dB].
    material : ndarray of uint8 or None, shape (rows, columns)
        Material id k of ``names[k - 1]``, 0 for mixed pixels.
    incidence_deg : ndarray of float32 or None, shape (rows, columns)
        Mean local incidence [deg].
    """

    reference_db: Floats | None = None
    calibrated_db: Floats | None = None
    material: Bytes | None = None
    incidence_deg: Floats | None = None


@dataclass(frozen=True)
class SceneView:
    """Scene, reduced to the resolution of the figures; row 0 is in the south.

    Attributes
    ----------
    step : int
        Step between the cells of the scene that are archived, in rows and columns.
    cell_m : float
        Width of a cell of the scene [m].
    material : ndarray of uint8, shape (y, x)
        Material id k of ``names[k - 1]``.
    elevation_m : ndarray of float32 or None, shape (y, x)
        Elevation [m].
    objects_m : ndarray of float32 or None, shape (objects, 2)
        Centres of objects (of many, every n-th), east and north of the south-west corner [m].
    crs : str or None
        Coordinate reference system, if the grid points to its north.
    west_m : float
        Coordinate of the south-west corner in this system [m].
    south_m : float
        Coordinate of the south-west corner in this system [m].
    imagery : ndarray of uint8 or None, shape (y, x, 3)
        Visible imagery: red, green, blue.
    """

    step: int
    cell_m: float
    material: Bytes
    elevation_m: Floats | None = None
    objects_m: Floats | None = None
    crs: str | None = None
    west_m: float = 0.0
    south_m: float = 0.0
    imagery: Bytes | None = None


@dataclass(frozen=True)
class PassResult:
    """Measured image of one pass, and the runs in this pass.

    Attributes
    ----------
    registered : Registered
        Measured image and its registration; only the first pass has images, as in ``registered.h5``.
    levels : Levels
        Level of the measured image relative to the simulated.
    keys : ndarray of str, shape (n,)
        Hash of each run, which names its record in ``runs/``.
    final_keys : tuple of str
        Hashes of the two final runs in this pass.
    rms : mapping of str to float
        Rms difference of the density of each material's best run from the target's, in this pass [1/dB or 1/IQR].
    """

    registered: Registered
    levels: Levels
    keys: NDArray[np.str_]
    final_keys: tuple[str, ...]
    rms: Mapping[str, float]


@dataclass(frozen=True)
class Archive(Stored, kind="calibration"):
    """Results of a calibration at its end.

    Attributes
    ----------
    config : str
        Configuration (JSON).
    decision : Decision
        Decision on the end of the search.
    measured_looks : float
        Equivalent number of looks (ENL) of the measured image's homogeneous areas.
    notes : tuple of Finding
        Findings on simulator and passes (JSON).
    law_notes : tuple of Finding
        Laws used outside of their validity (JSON).
    simulator : str
        Identity of the simulator (JSON).
    versions : str
        Versions of Python and packages (JSON).
    names : tuple of str
        Names of all materials, in the order of their ids.
    runs : Runs
        All n runs in their order: reference, registration, reused, design, infill.
    passes : mapping of str to PassResult
        Passes by their number from 1.
    image : Image
        What the fixed materials say of the images.
    findings : tuple of Finding
        Findings on images and materials (JSON).
    scene : SceneView
        Scene at the resolution of the figures; row 0 is in the south.
    laws : mapping of str to ndarray of float64, shape (d,)
        X of every material's law in the final runs.
    materials : mapping of str to MaterialResult
        Calibrated materials: d parameters, p pixels, m infill runs, b or c incidence-angle bins.
    images : Images
        Whole images; rows: slant range, columns: azimuth.
    """

    config: str
    decision: Decision
    measured_looks: float
    notes: tuple[Finding, ...]
    law_notes: tuple[Finding, ...]
    simulator: str
    versions: str
    names: tuple[str, ...]
    runs: Runs
    passes: Mapping[str, PassResult]
    image: Image
    findings: tuple[Finding, ...]
    scene: SceneView
    laws: Mapping[str, Doubles]
    materials: Mapping[str, MaterialResult]
    images: Images = field(default_factory=Images)

    @cached_property
    def configured(self) -> Case:
        """Configuration of the calibration; the values of a program's environment variables are not recorded."""
        sections = json.loads(self.config)
        sections["simulator"].pop("environment_sha256", None)
        return Case.model_validate(sections)

    @property
    def bins(self) -> bool:
        """Whether the objective compares incidence-angle bins, not the densities of all pixels."""
        return OBJECTIVES[self.configured.objective].bins

    @property
    def registered(self) -> Registered:
        """Measured image of the first pass and its registration."""
        return self.passes["1"].registered

    @property
    def levels(self) -> Levels:
        """Level of the measured image of the first pass relative to the simulated."""
        return self.passes["1"].levels

    @cached_property
    def measured_db(self) -> Floats:
        """Measured image of the first pass [dB], after subtraction of its assumed level."""
        return without_level(self.registered.measurement.image_db, self.levels)


def read_archive(path: str | Path, images: bool = True) -> Archive:
    """Read ``calibration.h5``.

    Parameters
    ----------
    path : path
        Path of the file.
    images : bool
        Whether the whole images are read, too; otherwise the fields of ``Archive.images`` are None.

    Returns
    -------
    Archive
        Results of the calibration, with the materials in the order of the configuration.

    Raises
    ------
    DamagedError, StoreError
        As for :func:`.read_hdf5`.
    """
    return Archive.read(path, () if images else ("images",))


def read_finished(folder: str | Path) -> Archive:
    """Archive of a results folder, without images.

    Raises
    ------
    DamagedError, StoreError
        As for :func:`read_archive`, or the calibration is not finished.
    """
    path = Path(folder) / "calibration.h5"
    if not path.is_file():
        raise StoreError(f"{folder}: the calibration is not finished, expected calibration.h5; radcal show says more.")
    return read_archive(path, images=False)


if __name__ == "__main__":
    print(table(Archive, unlisted=UNLISTED), end="")  # noqa: T201 - the module's output is the table

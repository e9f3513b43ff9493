"""Archive of all results of a calibration, ``calibration.h5``; the classes of this module define its layout.

``python -m radcal.results.archive`` prints the layout as a table, which ``docs/archive.md`` contains.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.conclusion import MaterialPixels
from radcal.calibration.stopping import Decision
from radcal.config import Case
from radcal.errors import StoreError
from radcal.findings import Finding
from radcal.ground.levels import Levels, without_level
from radcal.posterior.result import Image, Posterior
from radcal.registration.registered import Registered
from radcal.results.bin_statistics import BinStatistics
from radcal.results.search_front import SearchFront
from radcal.sections.objectives import OBJECTIVES
from radcal.storage.dataclass_groups import About, put, table, take
from radcal.storage.records import read_hdf5, write_hdf5
from radcal.targets.target import Target

_KIND = "calibration"
_UNIT = "dB or IQR"  # levels.unit says which of the two applies
_DENSITY = "1/dB or 1/IQR"
UNLISTED = (Registered, Target)
"""Classes whose fields the table of the layout does not list."""

Bytes = NDArray[np.uint8]
Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Runs:
    """All n runs of a calibration, in the order reference, reused, design, infill."""

    kind: Annotated[NDArray[np.str_], About("reference, registration, reused, design or infill", shape="n")]
    index: Annotated[Integers, About("number of the run within its kind", shape="n")]
    seconds: Annotated[Doubles, About("wall time of the simulator", "s", "n")]


@dataclass(frozen=True)
class Fidelity:
    """Proposals of the surrogate for each infill run, and statistics of the run; NaN without a prediction."""

    mode: Annotated[tuple[str, ...], About("mode of each proposal: exploit, explore, exhausted or ended", shape="m")]
    cost: Annotated[Doubles, About("cost that the surrogate predicted", shape="m")]
    floor: Annotated[
        Doubles, About("smallest cost that the surrogate allows within two standard errors; NaN if unknown", shape="m")
    ]
    predicted: Annotated[
        Doubles, About("predicted mean, log sd and skewness of each incidence-angle bin", _UNIT, "m, b, 3")
    ]
    error: Annotated[Doubles, About("kriging standard deviation of each predicted statistic", _UNIT, "m, b, 3")]
    verified: Annotated[
        Doubles, About("mean, log sd and skewness of each incidence-angle bin in the run", _UNIT, "m, b, 3")
    ]
    q2: Annotated[Doubles, About("leave-one-out Q2 of the surrogate, by statistic", shape="m, 3")]


@dataclass(frozen=True)
class MaterialResult:
    """Target and results of one calibrated material: d parameters, n runs, m infill runs, p pixels of the target."""

    targets: Annotated[
        Mapping[str, Target], About("target density and its measured pixels, by the number of the pass that shows it")
    ]
    simulated: Annotated[MaterialPixels, About("target's pixels in the reference run and both final runs")]
    textured: Annotated[bool, About("material has far fewer looks than the image's homogeneous areas")]
    level_only: Annotated[bool, About("material is seen at one incidence: only its level can be determined")]
    best: Annotated[int, About("best run, an index into `runs`")]
    parameters: Annotated[Doubles, About("X of each run; NaN for a run with another law", shape="n, d")]
    dp: Annotated[Doubles, About("xi, omega and alpha (no unit) of each run's density", _UNIT, "n, 3")]
    rms: Annotated[Doubles, About("rms difference of each run's density from the target's", _DENSITY, "n")]
    cost: Annotated[
        Doubles,
        About("quantity that the search minimises: half the sum of squared residuals of bins, or the rms", shape="n"),
    ]
    looks: Annotated[Doubles, About("effective number of looks at which each run fits the target best", shape="n")]
    posterior: Annotated[Posterior, About("posterior of the law")]
    prior: Annotated[Doubles, About("draws of X from the prior of the posterior", shape="2000, d")]
    hidden: Annotated[Doubles | None, About("true X of a synthetic measurement", shape="d")] = None
    fidelity: Annotated[Fidelity | None, About("proposals of the surrogate and the runs that verified them")] = None
    front: Annotated[SearchFront | None, About("front of the last search, if it had several objectives")] = None
    bins: Annotated[BinStatistics | None, About("statistics of incidence-angle bins; absent without bins")] = None

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
    """Whole images, with rows along slant range and columns along azimuth; None for an image that is not archived."""

    reference_db: Annotated[Floats | None, About("reference run", "dB", "rows, columns")] = None
    calibrated_db: Annotated[Floats | None, About("calibrated run with another seed", "dB", "rows, columns")] = None
    material: Annotated[
        Bytes | None, About("material id k of `names[k - 1]`, 0 for mixed pixels", shape="rows, columns")
    ] = None
    incidence_deg: Annotated[Floats | None, About("mean local incidence", "deg", "rows, columns")] = None


@dataclass(frozen=True)
class SceneView:
    """Scene, reduced to the resolution of the figures; row 0 is in the south."""

    step: Annotated[int, About("step between the cells of the scene that are archived, in rows and columns")]
    cell_m: Annotated[float, About("width of a cell of the scene", "m")]
    material: Annotated[Bytes, About("material id k of `names[k - 1]`", shape="y, x")]
    elevation_m: Annotated[Floats | None, About("elevation", "m", "y, x")] = None
    objects_m: Annotated[
        Floats | None,
        About("centres of objects (of many, every n-th), east and north of the south-west corner", "m", "objects, 2"),
    ] = None
    crs: Annotated[str | None, About("coordinate reference system, if the grid points to its north")] = None
    west_m: Annotated[float, About("coordinate of the south-west corner in this system", "m")] = 0.0
    south_m: Annotated[float, About("coordinate of the south-west corner in this system", "m")] = 0.0


@dataclass(frozen=True)
class PassResult:
    """Measured image of one pass, and the runs in this pass."""

    registered: Annotated[
        Registered, About("measured image and its registration; only the first pass has images, as in `registered.h5`")
    ]
    levels: Annotated[Levels, About("level of the measured image relative to the simulated")]
    keys: Annotated[NDArray[np.str_], About("hash of each run, which names its record in `runs/`", shape="n")]
    final_keys: Annotated[tuple[str, ...], About("hashes of the two final runs in this pass")]
    rms: Annotated[
        Mapping[str, float],
        About("rms difference of the density of each material's best run from the target's, in this pass", _DENSITY),
    ]


@dataclass(frozen=True)
class Archive:
    """Results of a calibration at its end."""

    config: Annotated[str, About("configuration (JSON)")]
    decision: Annotated[Decision, About("decision on the end of the search")]
    measured_looks: Annotated[
        float, About("equivalent number of looks (ENL) of the measured image's homogeneous areas")
    ]
    notes: Annotated[tuple[Finding, ...], About("findings on simulator and passes (JSON)")]
    law_notes: Annotated[tuple[Finding, ...], About("laws used outside of their validity (JSON)")]
    simulator: Annotated[str, About("identity of the simulator (JSON)")]
    versions: Annotated[str, About("versions of Python and packages (JSON)")]
    names: Annotated[tuple[str, ...], About("names of all materials, in the order of their ids")]
    runs: Annotated[Runs, About("all n runs in their order: reference, registration, reused, design, infill")]
    passes: Annotated[Mapping[str, PassResult], About("passes by their number from 1")]
    image: Annotated[Image, About("what the fixed materials say of the images")]
    findings: Annotated[tuple[Finding, ...], About("findings on images and materials (JSON)")]
    scene: Annotated[SceneView, About("scene at the resolution of the figures; row 0 is in the south")]
    laws: Annotated[Mapping[str, Doubles], About("X of every material's law in the final runs", shape="d")]
    materials: Annotated[
        Mapping[str, MaterialResult],
        About("calibrated materials: d parameters, p pixels, m infill runs, b or c incidence-angle bins"),
    ]
    images: Annotated[Images, About("whole images; rows: slant range, columns: azimuth")] = field(
        default_factory=Images
    )

    @cached_property
    def configured(self) -> Case:
        """Configuration of the calibration; the values of a program's environment variables are not recorded."""
        sections = json.loads(self.config)
        sections["simulator"].pop("environment_sha256", None)
        return Case.model_validate(sections, context=[])  # which collects contradictions: the case has run with them

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


def write_archive(path: str | Path, archive: Archive) -> None:
    """Write ``calibration.h5``, atomically.

    Parameters
    ----------
    path : path
        Path of the file.
    archive : Archive
        Results of a calibration.
    """
    with write_hdf5(path, _KIND) as file:
        put(file, archive)


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
    with read_hdf5(path, _KIND) as file:
        return take(file, Archive, without=() if images else ("images",))


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

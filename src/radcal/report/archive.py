"""Archive of every run and iteration, ``calibration.h5``: its types are its layout.

``docs/records.md`` has the layout as a table, which ``python -m radcal.report.archive`` writes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from radcal.radar.laws import Law, law_for
from radcal.storage.layout import About, Attribute, Inline, Main, put, table, take
from radcal.storage.records import read_hdf5, write_hdf5

__all__ = [
    "Archive",
    "Check",
    "HeldOutBlocks",
    "Images",
    "LawParameters",
    "LevelSummary",
    "MaterialResult",
    "ObjectPlaces",
    "RegistrationSummary",
    "Runs",
    "SceneView",
    "read_archive",
    "write_archive",
]

_KIND = "calibration"
_UNIT = "dB or IQR"  # as levels.unit says
_DENSITY = "1/dB or 1/IQR"

Bytes = NDArray[np.uint8]
Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Runs:
    """Runs in the order in which they count; n of them."""

    kind: Annotated[NDArray[np.str_], About("reference, reused, design or infill", shape="n")]
    index: Annotated[Integers, About("number within the kind", shape="n")]
    key: Annotated[NDArray[np.str_], About("hash of the record in `runs/`", shape="n")]
    seconds: Annotated[Doubles, About("wall time of the simulator", "s", "n")]


@dataclass(frozen=True)
class LawParameters:
    """Parameters of a law, with all that evaluating the law takes."""

    values: Annotated[Doubles, Main()]
    law: Annotated[str, About("name of the law")]
    polarisation: Annotated[str, About("transmitted and received polarisation")]
    frequency_ghz: Annotated[float | None, About("frequency", "GHz")] = None
    angles_deg: Annotated[tuple[float, ...] | None, About("knots of a law that has some", "deg")] = None
    names: Annotated[tuple[str, ...] | None, About("parameters of an external law, which has no curve")] = None
    units: Annotated[tuple[str, ...] | None, About("units of those parameters")] = None

    def curve(self) -> Law:
        """The law, to be evaluated.

        Raises
        ------
        ConfigError
            This version of radcal does not know the law.
        """
        return law_for(
            self.law,
            polarisation=self.polarisation,
            frequency_ghz=self.frequency_ghz,
            angles_deg=self.angles_deg,
            names=self.names,
            units=self.units,
        )


@dataclass(frozen=True)
class HeldOutBlocks:
    """Errors of block means on ground that no law has seen (:class:`radcal.calibration.validation.HeldOut`)."""

    rmse_law_db: Annotated[float, About("error of the means of held-out blocks predicted by the law alone", "dB")]
    rmse_law_patch_db: Annotated[float, About("by the law with the random effects of fields seen elsewhere", "dB")]
    rmse_constant_db: Annotated[float, About("by the mean of the calibrated ground", "dB")]
    rmse_best_db: Annotated[float, About("by the same law fitted to these means themselves", "dB")]
    rmse_start_db: Annotated[float, About("by the starting law; NaN where it has no curve", "dB")]
    ks_law: Annotated[float, About("Kolmogorov distance of held-out pixels from the density predicted by the law")]
    ks_constant: Annotated[float, About("from the density of the calibrated ground")]
    ks_start: Annotated[float, About("from the density predicted by the starting law")]
    tail_law_db: Annotated[float, About("predicted minus measured 99 % quantile, by the law", "dB")]
    tail_constant_db: Annotated[float, About("by the density of the calibrated ground", "dB")]
    tail_start_db: Annotated[float, About("by the starting law", "dB")]
    coverage_90: Annotated[float, About("share of block means inside of the 90 % band")]
    n_blocks: Annotated[int, About("held-out blocks compared")]
    block: Annotated[Integers, About("numbers of the held-out blocks", shape="b")]
    mean_db: Annotated[Doubles, About("measured means of the held-out blocks", "dB", "b")]
    predicted_db: Annotated[Doubles, About("means predicted by law and random effects of fields", "dB", "b")]
    law_db: Annotated[Doubles, About("means predicted by the law alone", "dB", "b")]
    sd_db: Annotated[Doubles, About("standard deviation of the prediction error", "dB", "b")]


@dataclass(frozen=True)
class Check:
    """How far to trust a law (:class:`radcal.calibration.law_check.LawCheck`)."""

    looks: Annotated[float, About("effective number of looks of the material")]
    looks_nominal: Annotated[float, About("number of looks of the simulated speckle")]
    constant_db: Annotated[float, About("mean of the calibrated ground", "dB")]
    between_db: Annotated[float, About("standard deviation between fields; NaN if not estimated", "dB")]
    within_db: Annotated[float, About("standard deviation within fields; NaN if not estimated", "dB")]
    incidence_error_deg: Annotated[float, About("standard error assumed of the local incidence", "deg")]
    class_deg: Annotated[Doubles, About("mean incidence of each incidence-angle bin", "deg", "c")]
    class_db: Annotated[Doubles, About("level that the measured pixels ask of the law there", "dB", "c")]
    class_error_db: Annotated[Doubles, About("standard error of `class_db`", "dB", "c")]
    sentences: Annotated[tuple[str, ...], Attribute(), About("warnings about the law")]
    identified: Annotated[bool | None, About("law identified by the image; only of a law with a curve")] = None
    held: Annotated[HeldOutBlocks | None, Inline()] = None


@dataclass(frozen=True)
class MaterialResult:
    """Target, runs and end of one calibrated material: d parameters, n runs, m infill runs, p pixels."""

    law: Annotated[str, About("name of the calibrated law")]
    parameter_names: Annotated[tuple[str, ...], Attribute(), About("names of its d parameters")]
    parameter_units: Annotated[tuple[str, ...], Attribute(), About("their units")]
    reason: Annotated[str, About("reason of the end, or running")]
    sentence: Annotated[str, About("the same in words")]
    eligible: Annotated[int, About("pixels that could have been drawn for the target")]
    at_boundary: Annotated[bool, About("target at the largest skewness of a skew normal")]
    rms_sampling: Annotated[float, About("rms that another sample of pixels would make", _DENSITY)]
    effective: Annotated[float, About("number of independent pixels that those drawn stand for")]
    looks: Annotated[float, About("equivalent number of looks (ENL) among neighbouring pixels")]
    textured: Annotated[bool, About("far fewer looks than the homogeneous areas of the image")]
    fresh: Annotated[bool, About("another seed gives other pixels")]
    left_out: Annotated[str, About("masked visible pixels by reason (JSON)")]
    fit_ks: Annotated[float, About("Kolmogorov-Smirnov distance of the pixels from their density")]
    fit_ks_p: Annotated[float, About("share of samples of that density that lie further from their own fit")]
    fit_ad: Annotated[float, About("Anderson-Darling statistic of the pixels and their density")]
    fit_ad_p: Annotated[float, About("share of samples with a larger one")]
    best: Annotated[int, About("best run, an index into `runs`")]
    parameters: Annotated[LawParameters, About("X of each run; NaN where the run is of another law", shape="n, d")]
    dp: Annotated[Doubles, About("xi, omega and alpha (no unit) of each run's density", _UNIT, "n, 3")]
    rms: Annotated[Doubles, About("difference of each run's density from the target", _DENSITY, "n")]
    bounds: Annotated[Doubles, About("search box", shape="d, 2")]
    start: Annotated[LawParameters, About("starting X, maybe of another law", shape="d")]
    target_dp: Annotated[Doubles, About("xi, omega and alpha (no unit) of the target", _UNIT, "3")]
    target_cp_error: Annotated[
        Doubles, About("standard errors of the target's mean, standard deviation and skewness (no unit)", _UNIT, "3")
    ]
    target_cp_interval: Annotated[Doubles, About("95 % intervals of the same", _UNIT, "3, 2")]
    pixels: Annotated[Integers, About("flat indices of the target's pixels in the image", shape="p")]
    incidence_deg: Annotated[Floats, About("local incidence of these pixels", "deg", "p")]
    measured_db: Annotated[Doubles, About("these pixels in the measured image", _UNIT, "p")]
    start_db: Annotated[Doubles, About("these pixels in the reference run", _UNIT, "p")]
    calibrated_db: Annotated[Doubles, About("these pixels in the calibrated run", _UNIT, "p")]
    fresh_db: Annotated[Doubles, About("these pixels in the calibrated run with another seed", _UNIT, "p")]
    check: Annotated[Check, About("how far to trust the law")]
    final_dp: Annotated[Doubles, About("xi, omega and alpha (no unit) of the calibrated run", _UNIT, "3")]
    fresh_dp: Annotated[Doubles, About("the same with another seed", _UNIT, "3")]
    predicted_rms: Annotated[Doubles, About("rms promised to each infill run; NaN if not", _DENSITY, "m")]
    floor_rms: Annotated[Doubles, About("smallest rms held possible before that run; NaN if unknown", _DENSITY, "m")]
    mode: Annotated[tuple[str, ...], About("exploit, explore, exhausted or ended", shape="m")]
    hidden: Annotated[Doubles | None, About("true X of a synthetic measurement", shape="d")] = None
    cost: Annotated[
        Doubles | None, About("half the sum of squared residuals of incidence-angle bins, by run", shape="n")
    ] = None
    run_looks: Annotated[Doubles | None, About("effective number of looks that suits each run best", shape="n")] = None


@dataclass(frozen=True)
class Images:
    """Whole images; rows: slant range, columns: azimuth. None where an image was not kept."""

    measured_db: Annotated[Floats | None, About("measured image less the level assumed", "dB", "rows, columns")] = None
    reference_db: Annotated[Floats | None, About("reference run", "dB", "rows, columns")] = None
    calibrated_db: Annotated[Floats | None, About("calibrated run with another seed", "dB", "rows, columns")] = None
    material: Annotated[Bytes | None, About("number k of `names[k - 1]`, 0 if mixed", shape="rows, columns")] = None
    incidence_deg: Annotated[Floats | None, About("mean local incidence", "deg", "rows, columns")] = None


@dataclass(frozen=True)
class ObjectPlaces:
    """Middles of objects; evenly spaced ones where there are many."""

    places_m: Annotated[Floats, Main()]
    count: Annotated[int, About("number of all objects")]


@dataclass(frozen=True)
class SceneView:
    """As much of the scene as pictures need; row 0 in the south."""

    step: Annotated[int, About("every step-th cell of the scene is kept")]
    cell_m: Annotated[float, About("side of a cell of the scene", "m")]
    material: Annotated[Bytes | None, About("number k of `names[k - 1]`", shape="y, x")] = None
    elevation_m: Annotated[Floats | None, About("elevation", "m", "y, x")] = None
    objects: Annotated[
        ObjectPlaces | None, About("middles of objects, east and north of the south-west corner", "m", "objects, 2")
    ] = None


@dataclass(frozen=True)
class RegistrationSummary:
    """Registration; its arrays where it was applied."""

    method: Annotated[str, About("gefolki, ilk or none")]
    applied: Annotated[bool, About("image moved")]
    verdict: Annotated[str, About("outcome in words")]
    unregistered_db: Annotated[Floats | None, About("measured image before", "dB", "rows, columns")] = None
    displacement_px: Annotated[
        Floats | None, About("place of each pixel in the measured image", "pixel", "2, rows, columns")
    ] = None
    uncertainty_px: Annotated[Floats | None, About("standard error of the displacement", "pixel", "rows, columns")] = (
        None
    )
    misregistration_px: Annotated[
        Floats | None, About("true displacement of a synthetic image", "pixel", "2, rows, columns")
    ] = None


@dataclass(frozen=True)
class LevelSummary:
    """Level of the measured image against the simulated (:class:`radcal.measurement.levels.Levels`)."""

    normalisation: Annotated[str, About("none, offset or image")]
    offset_db: Annotated[float, About("level of the measured image above the simulated; NaN if unknown", "dB")]
    offset_error_db: Annotated[float, About("its standard error", "dB")]
    scale: Annotated[float, About("spread of the measured image over that of the simulated")]
    sentence: Annotated[str, About("the same in words")]
    doubtful: Annotated[bool, About("level in doubt")]
    unit: Annotated[str, About("unit of densities and of the target's pixels: dB or IQR")]


@dataclass(frozen=True)
class Archive:
    """A calibration at its end."""

    case: Annotated[str, About("name of the case")]
    config: Annotated[str, About("configuration (JSON)")]
    objective: Annotated[str, About("density, classes or likelihood")]
    reason: Annotated[str, About("reason of the end, or running")]
    converged: Annotated[bool, About("every material within the tolerance, or its stop criterion met")]
    tolerance: Annotated[float, About("largest rms of a density", _DENSITY)]
    max_runs: Annotated[int, About("most runs of design and infill together")]
    looks: Annotated[int, About("number of looks of the simulation")]
    measured_looks: Annotated[
        float, About("equivalent number of looks (ENL) of the measured image's homogeneous areas")
    ]
    measurement: Annotated[str, About("source of the measured image")]
    notes: Annotated[tuple[str, ...], Attribute(), About("remarks on measurement and simulator")]
    law_notes: Annotated[tuple[str, ...], Attribute(), About("laws used outside of their validity")]
    sentences: Annotated[tuple[str, ...], Attribute(), About("end of each material in words")]
    simulator: Annotated[str, About("identity of the simulator (JSON)")]
    versions: Annotated[str, About("versions of Python and packages (JSON)")]
    final_runs: Annotated[int, About("final runs that were not simulated before")]
    names: Annotated[tuple[str, ...], About("names of all materials, in the order of their numbers")]
    runs: Annotated[Runs, About("runs in their order: reference, reused, design, infill (n of them)")]
    registration: Annotated[RegistrationSummary, About("registration of the measured image")]
    levels: Annotated[LevelSummary, About("level of the measured image against the simulated")]
    scene: Annotated[SceneView, About("scene, row 0 in the south")]
    laws: Annotated[Mapping[str, LawParameters], About("X of every material's law in the final runs", shape="d")]
    materials: Annotated[
        Mapping[str, MaterialResult],
        About("calibrated materials: d parameters, p pixels, m infill runs, c incidence-angle bins, b held-out blocks"),
    ]
    images: Annotated[Images, About("whole images; rows: slant range, columns: azimuth")] = field(
        default_factory=Images
    )


def write_archive(path: str | Path, archive: Archive) -> None:
    """Write ``calibration.h5``, atomically.

    Parameters
    ----------
    path : path
        The file.
    archive : Archive
        A calibration at its end.
    """
    with write_hdf5(path, _KIND) as file:
        put(file, archive)


def read_archive(path: str | Path, images: bool = True) -> Archive:
    """Read ``calibration.h5``.

    Parameters
    ----------
    path : path
        The file.
    images : bool
        Read the whole images, too; they are empty without.

    Returns
    -------
    Archive
        Materials in the order of the configuration.

    Raises
    ------
    DamagedError
        The file is damaged, of another version or of another case; it was set aside.
    StoreError
        It is missing or cannot be reached.
    """
    with read_hdf5(path, _KIND) as file:
        return take(file, Archive, without=() if images else ("images",))


if __name__ == "__main__":
    print(table(Archive), end="")  # noqa: T201 - the table is what was asked for

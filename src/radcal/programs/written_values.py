"""Checks of what placeholders write: numbers that resolve the bounds of a parameter, and distinct seeds.

A format with few digits makes the image change in steps, which no surrogate can represent, or gives the program values
outside of the bounds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from radcal.config import Case, Material, SyntheticMeasurement
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, SimulatorError
from radcal.programs.placeholders import SEED, Marked, Marker
from radcal.seeds import measurement_seed, noise_seed

_TRIED = 102  # values of a parameter that are written for the check: the bounds, and 100 between them
_FEWEST = 50  # different numbers that the bounds must be resolved by
_ROUNDING = 0.5 / _FEWEST  # largest share of the interval by which rounding may move a bound outwards


def check_numbers(materials: Mapping[str, Material], texts: Iterable[Marked]) -> None:
    """Raise an error if a placeholder's format cannot write the bounds, or resolves them by too few numbers.

    Parameters
    ----------
    materials : mapping
        Materials by name, with the bounds of the calibrated parameters.
    texts : iterable of Marked
        Arguments and templates.

    Raises
    ------
    ConfigError
        The number written for a bound lies outside of the bounds by more than 1 % of their interval, the values
        between the bounds are written as fewer than 50 different numbers, a bound of an integer parameter is
        written as another number, or a number is wider than the field of its placeholder.
    """
    boxes: dict[str, tuple[float, float, bool]] = {}
    for name, one in materials.items():
        values = one.box if one.calibrate else [(x, x) for x in one.parameters or ()]
        for key, (low, high), whole in zip(one.parameter_names, values, one.integers, strict=True):
            boxes[f"{name}.{key}"] = (low, high, whole)
    for marked in texts:
        for marker in marked.markers:
            if marker.spec and marker.name in boxes:
                _check(marker, *boxes[marker.name], marked.where)


def _check(marker: Marker, low: float, high: float, whole: bool, where: str) -> None:
    """Raise an error if one placeholder cannot write the values of one parameter; fixed ones must fit the field."""
    values = (low, high) if low == high or whole else tuple(map(float, np.linspace(low, high, _TRIED)))
    try:
        texts = [marker.text(int(x) if whole else x, where) for x in values]
    except SimulatorError as error:
        raise ConfigError(str(error)) from None
    try:
        written = [float(text) for text in texts]
    except ValueError:  # a notation such as 30 %, which only the program can read
        return
    if low == high:
        return
    ends = f"{marker.name}:{marker.spec} writes the bounds [{low:g}, {high:g}] of {marker.name} as {texts[0].strip()}"
    ends = f"{where}: {ends} and {texts[-1].strip()}"
    if whole:
        if written != [low, high]:
            raise ConfigError(
                f"{ends}, expected the same whole numbers: write {marker.name}:d, or {marker.name} alone."
            )
        return
    rounding, different = _ROUNDING * (high - low), len(set(written))
    if different < _FEWEST or min(written) < low - rounding or max(written) > high + rounding:
        raise ConfigError(
            f"{ends}, and {_TRIED} values from bound to bound as {different} different numbers, expected at least "
            f"{_FEWEST}, all inside of the bounds: write more digits, or {marker.name} alone for all of them."
        )


def check_seeds(case: Case, texts: Iterable[Marked]) -> None:
    """Raise an error if the placeholders map different seeds of a case to the same number.

    Parameters
    ----------
    case : Case
        The configuration.
    texts : iterable of Marked
        Arguments and templates with placeholders.

    Raises
    ------
    ConfigError
        Two of the following would receive the same number: the runs of the calibration, the final run with fresh random
        numbers, the synthetic measurement.
    SimulatorError
        The text of a seed is wider than the field of its placeholder.
    """
    runs = STAGES["reference_run"].of(case)
    seeds = {
        "the runs of the calibration": noise_seed(runs),
        "the final run with fresh random numbers": noise_seed(runs, fresh=True),
    }
    if isinstance(case.measurement, SyntheticMeasurement):
        seeds["the synthetic measurement"] = measurement_seed(case.simulator, case.measurement.synthetic.seed)
    seen: dict[tuple[str, ...], str] = {}
    places = [(one.where, marker) for one in texts for marker in one.markers if marker.name == SEED]
    for what, seed in seeds.items():
        text = tuple(marker.text(seed, where) for where, marker in places)
        if text and text in seen:
            raise ConfigError(
                f"{places[0][0]}: {SEED} is {text[0].strip()} for {seen[text]} as for {what}: change seed (it is "
                f"{case.seed}), or widen the range."
            )
        seen[text] = what

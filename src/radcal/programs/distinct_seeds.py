"""Check that an external program receives distinct seeds."""

from __future__ import annotations

from collections.abc import Iterable

from radcal.config import Case, SyntheticMeasurement
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.programs.placeholders import SEED, Marked, Marker
from radcal.seeds import measurement_seed, noise_seed


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
    parts = ((one.where, part) for one in texts for part in one.parts)
    places = [(where, part) for where, part in parts if isinstance(part, Marker) and part.name == SEED]
    for what, seed in seeds.items():
        text = tuple(marker.text(seed, where) for where, marker in places)
        if text and text in seen:
            raise ConfigError(
                f"{places[0][0]}: {SEED} is {text[0].strip()} for {seen[text]} as for {what}: change seed (it is "
                f"{case.seed}), or widen the range."
            )
        seen[text] = what

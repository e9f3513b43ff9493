"""Number of bits of the seeds for an external program, and a check that the seeds of a case are distinct.

In a new case the program receives seeds of 31 bits, which fit into a C int. A case with earlier runs keeps the number
of bits in its simulator.json, because runs with other seeds would not match the earlier runs.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable
from pathlib import Path

from radcal.config import Case, CommandSimulation, SyntheticMeasurement
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.programs.placeholders import SEED, Marked, Marker
from radcal.seeds import measurement_seed, noise_seed
from radcal.storage.inspection import inspect_file


def with_seed_bits(case: Case, results: str | Path) -> Case:
    """Case with ``simulator.seed_bits`` set, if the simulator is an external program.

    Parameters
    ----------
    case : Case
        The configuration.
    results : path
        Folder that contains the results folders of all cases.

    Returns
    -------
    Case
        Case with the configured ``simulator.seed_bits``. If the key is missing, the value comes from the results of the
        case, else from the results of the case named by ``design.reuse``, else it is 31. No file is changed.
    """
    simulator = case.simulator
    if not isinstance(simulator, CommandSimulation) or simulator.seed_bits is not None:
        return case
    recorded = (_recorded(Path(results) / name) for name in (case.case, case.design.reuse) if name is not None)
    bits = next((bits for bits in recorded if bits is not None), simulator.seed_width)
    return case.model_copy(update={"simulator": simulator.model_copy(update={"seed_bits": bits})})


def _recorded(folder: Path) -> int | None:
    """Number of bits of the seeds, from the simulator.json of a case; None if it has none."""
    for name in ("passes/1/simulator.json", "simulator.json"):  # the second one of an earlier version of radcal
        # radcal.session.salvage reports damaged files
        with contextlib.suppress(Exception):
            inspect_file(folder / name, None)
            return int(json.loads((folder / name).read_text(encoding="utf-8"))["data"]["seed_bits"])
    return None


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

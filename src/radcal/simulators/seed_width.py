"""Bit width of an external program's seeds, and the check that a case's seeds stay distinct.

A C int takes 31 bits, and that is what a new case hands over. A case that has runs keeps the
width that they were made with: other seeds would be other runs.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable
from pathlib import Path

import h5py

from radcal.config import Case, CommandSimulation, SyntheticMeasurement, stages
from radcal.errors import ConfigError
from radcal.seeds import measurement_seed, noise_seed
from radcal.simulators.placeholders import SEED, Marker
from radcal.storage.inspection import inspect_file

__all__ = ["check_seeds", "with_seed_bits"]

_EARLIER = 63  # of all runs from the time before there was a choice
_INT = 31


def with_seed_bits(case: Case, results: str | Path) -> Case:
    """The case with the width of its seeds settled.

    Parameters
    ----------
    case : Case
        The configuration.
    results : path
        Folder of all cases' results.

    Returns
    -------
    Case
        ``simulator.seed_bits`` of an external program is what the case says; else what its own results record,
        or those of the case whose runs it takes; else the default. Nothing is changed on disk.
    """
    simulator = case.simulator
    if not isinstance(simulator, CommandSimulation) or simulator.seed_bits is not None:
        return case
    bits = None
    for name in (case.case, case.design.reuse):
        if bits is None and name is not None:
            bits = _recorded(Path(results) / name)
    update = {"seed_bits": simulator.seed_width if bits is None else bits}
    return case.model_copy(update={"simulator": simulator.model_copy(update=update)})


def _recorded(folder: Path) -> int | None:
    """Width that a case's simulator.json says, or that its runs show; None where there are neither."""
    path = folder / "simulator.json"
    # what is damaged is for salvage to say, whatever is wrong with it
    with contextlib.suppress(Exception):
        inspect_file(path, None)
        return int(json.loads(path.read_text(encoding="utf-8"))["data"]["seed_bits"])
    for path in sorted((folder / "runs").glob("[!.]*.h5")):
        with contextlib.suppress(Exception), h5py.File(path, "r", locking=False) as file:
            description = json.loads(str(file.attrs["description"]))
            if description["simulator"]["kind"] == "command" and int(description[SEED]) >= 2**_INT:
                return _EARLIER
    return None


def check_seeds(case: Case, places: Iterable[tuple[str, Marker]]) -> None:
    """Refuse ranges and fields that make one seed of the seeds of a case.

    Parameters
    ----------
    case : Case
        The configuration.
    places : iterable of (str, Marker)
        Every place where the program gets its seed, and what messages call it.

    Raises
    ------
    ConfigError
        The calibration's runs and the final one with fresh random numbers, or the synthetic measurement, would
        have the same seed.
    SimulatorError
        A seed is wider than its field.
    """
    runs = stages.Simulation.of(case)
    seeds = {
        "the runs of the calibration": noise_seed(runs),
        "the final run with fresh random numbers": noise_seed(runs, fresh=True),
    }
    if isinstance(case.measurement, SyntheticMeasurement):
        seeds["the synthetic measurement"] = measurement_seed(case.simulator, case.measurement.synthetic.seed)
    seen: dict[tuple[str, ...], str] = {}
    places = list(places)
    for what, seed in seeds.items():
        text = tuple(marker.text(seed, where) for where, marker in places)
        if text and text in seen:
            raise ConfigError(
                f"{places[0][0]}: {SEED} is {text[0].strip()} for {seen[text]} as for {what}: change seed (it is "
                f"{case.seed}), or widen the range."
            )
        seen[text] = what

"""Bit width of an external program's seeds, and the check that a case's seeds stay distinct.

In a new case the program gets seeds of 31 bits, which a C int holds. A case that already has runs keeps the bit width
of the seeds of these runs, because other seeds would make other runs.
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

_EARLIER = 63  # width of all runs made before the width could be chosen
_INT = 31


def with_seed_bits(case: Case, results: str | Path) -> Case:
    """Case in which the bit width of an external program's seeds is set.

    Parameters
    ----------
    case : Case
        The configuration.
    results : path
        Folder of all cases' results.

    Returns
    -------
    Case
        Case with ``simulator.seed_bits`` of an external program from the configuration, else from its own results or
        those of the case whose runs it reuses, else the default. No file is changed.
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
    """Bit width of seeds from a case's simulator.json, else as seen from its stored runs; None if neither tells it."""
    path = folder / "simulator.json"
    # damaged files are reported by salvage
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
    """Refuse placeholders whose ranges or fields map different seeds of a case to the same number.

    Parameters
    ----------
    case : Case
        The configuration.
    places : iterable of (str, Marker)
        Every placeholder of the seed, with its name in messages.

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

"""Searches for the density of the published dyke: counted runs of one target, and a file of finished searches."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from dyke_cases import Bench, hidden_laws
from numpy.typing import NDArray

from radcal.calibration.loop import calibrate
from radcal.calibration.scoring import score
from radcal.calibration.steps import all_parameters, run_all_draws
from radcal.config import load
from radcal.config.stages import STAGES
from radcal.inference.moments import from_dp
from radcal.objectives import make_objectives
from radcal.processes import one_thread
from radcal.proposals import surrogate
from radcal.proposals.smt_kriging import train_smt
from radcal.seeds import derived_seed
from radcal.simulators.base import Simulator
from radcal.storage.files import atomic

READINGS = {"rms": 1e-5, "mean_square": math.sqrt(1e-5)}  # the published tolerance of 1e-5, as a bound on the rms
Doubles = NDArray[np.float64]
Row = Mapping[str, Any]
_NAME = "dyke"
_NEVER = 1e12  # stands for infinitely many runs, between which and a number there is no quantile
_RETRAINED = 20  # runs after which the published setting estimates its length scales again


class Ended(Exception):
    """End of a search: the rms is within the tolerance, or the runs or the time are used up."""


class Timed:
    """Simulator with the CPU time of its runs [s]."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator, self.identity, self.seconds = simulator, simulator.identity, 0.0

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Image of a run [dB]."""
        began = _cpu_s()
        found = self._simulator.run(parameters, noise_seed)
        self.seconds += _cpu_s() - began
        return found


class TimedBench(Bench):
    """Bench with a simulator that is timed."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.timed = self.simulator = Timed(self.simulator)


class Problem:
    """Target of one case, with runs that are scored and counted.

    Parameters
    ----------
    bench : TimedBench
        Scene and simulator.
    path, folder : path
        Case file, and folder for its runs and for what a search keeps to be continued.
    seed : int
        Seed for the random numbers of a method.
    most : int
        Largest number of runs.
    most_s : float
        Largest CPU time of the search, without the simulator [s].

    Attributes
    ----------
    folder : path
        The given folder.
    earlier_s : float
        CPU time of a search that was begun earlier and is continued [s].
    start, start_residuals : ndarray
        X of the reference run in the unit box, and the residuals of this run, which is not counted.
    rms : list of float
        Rms of each counted run [1/dB].
    """

    def __init__(
        self, bench: TimedBench, path: Path, folder: Path, seed: int, most: int, most_s: float = math.inf
    ) -> None:
        self.folder, self.earlier_s = folder, 0.0
        self.case, self.seed, self._limits = load([path]), seed, (most, most_s)
        self.rms: list[float] = []
        self.runner = bench.runner(self.case, folder / "runs")
        self.targets = bench.targets(self.case, self.runner)
        self._objectives = make_objectives(STAGES["scores"].of(self.case), [self.targets])
        (objective,) = self._objectives[_NAME].passes
        assert objective is not None  # a case of one pass
        self._target, self._scale = from_dp(objective.material.target.dp)[None], objective.scale
        self._low, high = np.array(self.case.materials[_NAME].box).T
        self._width = high - self._low
        self.start = (np.array(self.case.materials[_NAME].start_parameters) - self._low) / self._width
        self.start_residuals = self._run(self.start)[0]
        self._timed, self._began_s = bench.timed, _cpu_s() - bench.timed.seconds

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self.start)

    def own_s(self) -> float:
        """CPU time of the search, without the simulator [s]."""
        return self.earlier_s + _cpu_s() - self._timed.seconds - self._began_s

    def residuals(self, unit: Doubles) -> Doubles:
        """Differences of mean, log sd and skewness from the target's, scaled as in radcal, of the run at X.

        Parameters
        ----------
        unit : ndarray, shape (d,)
            X in the unit box.

        Raises
        ------
        Ended
            The run is within the tolerance, or is the last one.
        """
        if np.allclose(unit, self.start, rtol=0.0, atol=1e-12):  # PEST++ gets and returns X + 1
            return self.start_residuals
        found, rms = self._run(unit)
        self.rms.append(rms)
        if rms <= READINGS["rms"]:
            raise Ended("rms")
        most, most_s = self._limits
        if len(self.rms) >= most:
            raise Ended("max_runs")
        if self.own_s() > most_s:
            raise Ended("time")
        return found

    def _run(self, unit: Doubles) -> tuple[Doubles, float]:
        x = self._low + np.clip(unit, 0.0, 1.0) * self._width
        parameters = all_parameters(self.case.materials, {_NAME: x.tolist()})
        records = run_all_draws(STAGES["verify"].of(self.case), [self.runner], parameters)
        run = score("infill", 0, records, parameters, [self.targets], self._objectives, self.case.seed)
        found = run.scores[_NAME]
        return ((np.array(found.statistics) - self._target) / self._scale)[0], found.rms


def _cpu_s() -> float:
    return float(sum(os.times()[:4]))  # of this process and its children, user and system


@contextmanager
def problem_of(
    bench: TimedBench,
    method: str,
    target: str,
    number: int,
    settings: Mapping[str, Any],
    folder: Path,
    most: int = 1200,
    most_s: float = math.inf,
) -> Iterator[Problem]:
    """Problem of one hidden law.

    Parameters
    ----------
    bench : TimedBench
        Scene and simulator.
    method : str
        Name of the method, from which its seed is derived.
    target : {'reachable', 'speckled'}
        Whether the measured image has the speckle of the runs, or its own.
    number : int
        Number of the hidden law.
    settings : mapping
        Keys of the case.
    folder : path
        Folder of the search, with the runs that it has made before, if it is continued.
    most, most_s : int, float
        Largest number of runs, and largest CPU time of the search [s].
    """
    with one_thread():
        truth = hidden_laws(number + 1)[number].tolist()
        keys = {"objective": "density", **settings}
        if target == "reachable":
            path = bench.reachable("case", truth, keys)
        else:
            path = bench.speckled("case", truth, number + 1000, keys)  # an image's seed is not that of the runs
        seed = derived_seed(1, "benchmark", method, target, str(number)) % 2**31
        yield Problem(bench, path, folder, seed, most, most_s)


def calibrated(problem: Problem, published: bool = False) -> str:
    """Calibrate by radcal with the settings of the case; return the reason of the end.

    Parameters
    ----------
    problem : Problem
        Problem, whose list of rms is filled.
    published : bool
        Whether smt estimates the length scales again every 20 runs only, and solutions are ranked by a sort in place
        of Platypus' comparisons of all pairs, which take two thirds of the time and give the same ranks. The length
        scales are kept, so that a search of hours goes on after a kill.
    """
    path = problem.folder / "scales.json"
    kept = json.loads(path.read_text()) if path.exists() else {"own_s": 0.0}
    problem.earlier_s = kept["own_s"]
    calls = iter(range(10**9))

    def every(unit: Doubles, values: Doubles, noisy: bool = False) -> Any:
        key = f"{len(unit) // _RETRAINED}.{next(calls) % 3}"  # smt learns the three outputs in turn
        if key not in kept:
            scales, nugget, status = train_smt(unit, values, noisy)
            kept.update({key: [scales.tolist(), nugget, status], "own_s": problem.own_s()})
            with atomic(path) as partial:
                partial.write_text(json.dumps(kept))
        scales, nugget, status = kept[key]
        return np.array(scales), nugget, status

    with ExitStack() as patched:
        if published:
            patched.enter_context(mock.patch.object(surrogate, "train_smt", every))
            patched.enter_context(mock.patch("platypus.algorithms.nondominated_sort", _sorted))
        history, decision = calibrate(problem.case, [problem.runner], [problem.targets])
    problem.rms += [run.scores[_NAME].rms for run in history.runs if run.kind in ("design", "infill")]
    return str(decision.reason)


def _sorted(solutions: Sequence[Any]) -> None:
    """Rank and crowding distance of Platypus' ``nondominated_sort`` for solutions with one objective."""
    found = [solution.objectives[0] for solution in solutions]
    rank = {value: k for k, value in enumerate(sorted(set(found)))}
    first = dict(zip(reversed(found), reversed(solutions), strict=True))
    for value, solution in zip(found, solutions, strict=True):
        solution.rank = rank[value]
        solution.crowding_distance = math.inf if first[value] is solution else 0.0


class Results:
    """Finished searches, one JSON object a line; a search that the file holds is not made again.

    Parameters
    ----------
    path : path
        File of results.
    cases : path
        Folder for the case files; it must exist.
    """

    def __init__(self, path: Path, cases: Path) -> None:
        self._path, self._bench = path, TimedBench(cases)
        self.rows = self._read()

    def _read(self) -> list[Row]:
        return [json.loads(line) for line in self._path.read_text().splitlines()] if self._path.exists() else []

    def of(self, keys: Row) -> list[Row]:
        """Searches with these values."""
        return [row for row in self.rows if keys.items() <= row.items()]

    def search(self, keys: Row, search: Callable[[Problem], str], **limits: Any) -> Row:
        """Result of one search, from the file or made now.

        Parameters
        ----------
        keys : mapping
            ``method``, ``target`` and ``number`` of :func:`problem_of`, and further keys that name the search.
        search : callable
            Method, which returns the reason of its end or is ended by :class:`Ended`.
        **limits
            Settings and limits of :func:`problem_of`.
        """
        for row in self.of(keys):
            return row
        # the folder of a search that is killed stays, and its runs are not made again
        folder = self._path.with_name("_".join([self._path.stem, *map(str, keys.values())]))
        with problem_of(
            self._bench, keys["method"], keys["target"], keys["number"], folder=folder, **limits
        ) as problem:
            try:
                ended = search(problem)
            except Ended as end:
                ended = str(end)
            lowest = np.minimum.accumulate(problem.rms)
            better = np.flatnonzero(np.diff(lowest, prepend=np.inf) < 0.0)
            best = [[int(k) + 1, float(lowest[k])] for k in better]
            own_s = round(problem.own_s(), 2)
        row = {**keys, "ended": ended, "runs": len(lowest), "own_s": own_s, "best": best}
        self.rows = [*self._read(), row]  # another program may have added some
        with atomic(self._path) as partial:
            partial.write_text("".join(json.dumps(one) + "\n" for one in self.rows))
        shutil.rmtree(folder, ignore_errors=True)
        print(
            json.dumps({key: value for key, value in row.items() if key != "best"}),
            f"lowest {best[-1][1]:.1e}",
            flush=True,
        )
        return row


def runs_to(row: Row, rms: float) -> float:
    """Number of runs until the rms of a search was first within a bound; infinite if it never was."""
    return next((float(run) for run, found in row["best"] if found <= rms), math.inf)


def quartiles(runs: Iterable[float]) -> list[float | None]:
    """Quartiles of numbers of runs; None in place of one that not enough searches have reached."""
    found = np.quantile(np.minimum(list(runs), _NEVER), (0.25, 0.5, 0.75))
    return [float(one) if one < _NEVER / 1e3 else None for one in found]

"""Runs of a calibration in their order, with the score of each against the targets, and proposals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.errors import StoreError
from radcal.storage.records import read_json, write_json

__all__ = [
    "History",
    "Kind",
    "PassScore",
    "Proposal",
    "Run",
    "Score",
    "read_proposals",
    "read_runs",
    "write_proposals",
    "write_runs",
]

Kind = Literal["reference", "reused", "design", "infill"]


@dataclass(frozen=True)
class Proposal:
    """Next X of a material, and what its surrogate predicts there.

    Attributes
    ----------
    parameters : list of float
        Proposed X.
    mode : {'exploit', 'explore', 'exhausted', 'ended'}
        Best predicted point; point that could be best at the surrogate's accuracy; the verified best where every
        combination of whole parameters has been simulated, or of a material that needs no further run.
    looks : float or None
        Effective number of looks proposed with X.
    cost : float or None
        Cost that the surrogate predicts at the proposal, in the unit of the objective.
    floor : float or None
        Smallest cost anywhere in the box with the statistics two standard errors of the surrogate in favour; None where
        it was not searched for.
    nsga2_cost : float or None
        Predicted cost of NSGA-II's best point, before the least-squares fit.
    statistics, errors : list of list of float
        Statistics predicted at the proposal, and their kriging standard deviations, shape (n, 3).
    q2 : list of float or None
        Leave-one-out Q2 of the surrogate for mean, log sd and skewness; None where a single run tells none.
    """

    parameters: list[float]
    mode: Literal["exploit", "explore", "exhausted", "ended"]
    looks: float | None = None
    cost: float | None = None
    floor: float | None = None
    nsga2_cost: float | None = None
    statistics: list[list[float]] = field(default_factory=list)
    errors: list[list[float]] = field(default_factory=list)
    q2: list[float | None] = field(default_factory=list)


@dataclass(frozen=True)
class PassScore:
    """Density of a material in the second or a later pass of a run.

    Attributes
    ----------
    dp : list of float
        xi [dB], omega [dB], alpha.
    rms : float
        Root-mean-square difference from the density of that pass's target [1/dB].
    """

    dp: list[float]
    rms: float


@dataclass(frozen=True)
class Score:
    """Score of one material in one run, with several passes of the same X in all of them.

    Attributes
    ----------
    parameters : list of float
        X.
    dp : list of float
        Density of the material's pixels with the texture of ``looks``, in the first pass: xi [dB], omega [dB], alpha.
    rms : float
        Root-mean-square difference of that density from the target's [1/dB].
    statistics : list of list of float
        Mean [dB], log sd and skewness of each incidence-angle bin at the sensor's looks, shape (n, 3), one pass after
        the other; a single row for the density of a pass.
    looks : float
        Effective number of looks with which the run fits the target best.
    cost : float
        Quantity that the objective minimises.
    own_law : bool
        False where the run gave the material another law than the one that is calibrated: its X is none of that law's,
        and the run counts for nothing but the score at the start.
    gain : float or None
        For infill: what the best X on the surrogate of all runs so far would take from the smallest verified cost; None
        for an objective that does not stop by it.
    floor : float or None
        The same cost with the statistics two standard errors of the surrogate in favour; None where it was not searched
        for.
    moved_db : float or None
        Largest difference of the laws of these two X over the incidence seen [dB].
    further : list of PassScore or None
        Densities in the second and later passes; None in a pass with too few pixels of the material.
    """

    parameters: list[float]
    dp: list[float]
    rms: float
    statistics: list[list[float]]
    looks: float
    cost: float
    own_law: bool = True
    gain: float | None = None
    floor: float | None = None
    moved_db: float | None = None
    further: list[PassScore | None] = field(default_factory=list)


@dataclass(frozen=True)
class Run:
    """A run and its score by calibrated material.

    Attributes
    ----------
    kind : {'reference', 'reused', 'design', 'infill'}
        Reused ones are of an earlier case; they train, and count for no maximum.
    index : int
        Number within its kind.
    key : str
        Hash of the record.
    seconds : float
        Wall time of the simulator.
    scores : mapping
        Score by material.
    proposals : mapping
        Proposal by material, for infill.
    repeat_db : float or None
        For a repeated reference run: largest difference of its pixels from the first's [dB].
    repeat_variance : mapping by material
        For one that differs: variance of the statistics among runs of equal parameters, shape (n, 3).
    rms_sampling : mapping by material
        For the reference run: density rms of a sample as large as the target's [1/dB].
    """

    kind: Kind
    index: int
    key: str
    seconds: float
    scores: Mapping[str, Score]
    proposals: Mapping[str, Proposal] = field(default_factory=dict)
    repeat_db: float | None = None
    repeat_variance: Mapping[str, list[list[float]]] = field(default_factory=dict)
    rms_sampling: Mapping[str, float] = field(default_factory=dict)
    further_keys: list[str] = field(default_factory=list)


class History:
    """Scored runs in the order in which they were made.

    Parameters
    ----------
    runs : iterable of Run
        Reference, reused, design, then infill.
    """

    def __init__(self, runs: Iterable[Run]) -> None:
        self.runs: Sequence[Run] = tuple(runs)

    @property
    def infill(self) -> list[Run]:
        """Verified proposals."""
        return [run for run in self.runs if run.kind == "infill"]

    @property
    def repeat_db(self) -> list[float]:
        """Largest difference of each repeated reference run's pixels from the first's [dB]."""
        return [run.repeat_db for run in self.runs if run.repeat_db is not None]

    def rms_sampling(self, material: str) -> float:
        """Density rms of a sample as large as the material's target [1/dB], 0 where it was not recorded."""
        return max((run.rms_sampling.get(material, 0.0) for run in self.runs), default=0.0)

    def noise_variance(self, material: str) -> NDArray[np.float64] | None:
        """Variance of the statistics among runs of equal parameters, shape (n, 3), None where it was not measured."""
        found = [run.repeat_variance[material] for run in self.runs if material in run.repeat_variance]
        return np.mean(found, axis=0) if found else None

    def count(self, kind: Kind) -> int:
        """Return the number of runs of a kind."""
        return sum(run.kind == kind for run in self.runs)

    def best(self, material: str) -> Run:
        """Return the run with the material's smallest cost, the earliest of equals, made with its law."""
        own = (run for run in self.runs if run.scores[material].own_law)
        return min(own, key=lambda run: run.scores[material].cost)

    def failures(self, material: str) -> int:
        """Return the number of verified proposals since the best one (or since the design)."""
        best = self.best(material)
        since = self.infill if best.kind != "infill" else self.infill[self.infill.index(best) + 1 :]
        return sum(run.proposals[material].mode != "ended" for run in since)

    def training(self, material: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distinct parameters and their statistics.

        Returns
        -------
        parameters : ndarray, shape (k, d)
        statistics : ndarray, shape (k, n, 3)
            Mean [dB], log sd and skewness; of a repeated X those of the latest run, in which the laws of the neighbours
            are nearest to their own.
        """
        seen: dict[tuple[float, ...], list[list[float]]] = {}
        for run in self.runs:
            score = run.scores[material]
            if score.own_law:
                seen[tuple(score.parameters)] = score.statistics
        return np.array(list(seen)), np.array(list(seen.values()))

    def surprise(self, material: str) -> NDArray[np.float64]:
        """Mean square of verified minus predicted statistics over the kriging variance that was stated for it.

        The sums run over all verified proposals and incidence-angle bins. Noise of the runs, where it was measured, is
        taken off. Proposals that repeat a run, or were predicted without any error (as by a single run), do not count.

        Returns
        -------
        ndarray, shape (3,)
            Of mean, log sd and skewness; 1 where nothing was predicted with an error.

        References
        ----------
        Bastos and O'Hagan, "Diagnostics for Gaussian process emulators", Technometrics 51 (2009), section 3: errors of
        validation runs over their predicted standard deviations.
        """
        pairs = [(run.proposals[material], run.scores[material]) for run in self.infill if material in run.proposals]
        pairs = [(one, score) for one, score in pairs if one.mode in ("exploit", "explore") and np.any(one.errors)]
        if not pairs:
            return np.ones(3)
        noise = self.noise_variance(material)
        square = sum((np.array(score.statistics) - np.array(one.statistics)) ** 2 for one, score in pairs)
        square = square - (0.0 if noise is None else len(pairs) * noise)
        stated = np.sum([np.square(one.errors).sum(axis=0) for one, _ in pairs], axis=0)
        found = np.maximum(np.asarray(square).sum(axis=0), 0.0) / np.where(stated > 0.0, stated, np.nan)
        return np.where(np.isfinite(found), found, 1.0)


def write_runs(path: str | Path, runs: Iterable[Run]) -> None:
    """Write scored runs as JSON; what only several passes have is omitted where there is one."""
    written = [asdict(run) for run in runs]
    for run in written:
        for item, key in [(run, "further_keys"), *((score, "further") for score in run["scores"].values())]:
            if not item[key]:
                del item[key]
    write_json(path, written)


def read_runs(paths: Iterable[str | Path]) -> History:
    """Read scored runs from files, in the order of the files."""

    def parse(path: str | Path, data: dict[str, Any]) -> Run:
        if "scores" not in data:
            raise StoreError(
                f"{path}: was written by an earlier version of radcal; delete it and type the same command again to "
                "make it again (finished runs are kept)."
            )
        scores = {name: _score(item) for name, item in data.pop("scores").items()}
        proposals = {name: Proposal(**item) for name, item in data.pop("proposals").items()}
        return Run(**data, scores=scores, proposals=proposals)

    return History(parse(path, data) for path in paths for data in read_json(path))


def _score(data: dict[str, Any]) -> Score:
    further = [None if item is None else PassScore(**item) for item in data.pop("further", [])]
    return Score(**data, further=further)


def write_proposals(path: str | Path, proposals: Mapping[str, Proposal]) -> None:
    """Write proposals as JSON."""
    write_json(path, {name: asdict(proposal) for name, proposal in proposals.items()})


def read_proposals(path: str | Path) -> dict[str, Proposal]:
    """Read proposals that :func:`write_proposals` wrote."""
    return {name: Proposal(**data) for name, data in read_json(path).items()}

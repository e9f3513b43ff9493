"""Runs of a calibration with their scores against the targets, and proposals of parameters for further runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.storage.records import from_json, read_json, understood, write_json

Kind = Literal["reference", "registration", "reused", "design", "infill"]


@dataclass(frozen=True)
class Front:
    """Front of NSGA-II's last population for several objectives; of two points, each is better in one objective.

    Attributes
    ----------
    parameters : list of list of float
        X of f points, shape (f, d), in ascending order of the sum of the objectives.
    looks : list of float
        Effective number of looks of each point.
    objectives : list of list of float
        The p objectives that the surrogate predicts at each point, shape (f, p).
    """

    parameters: list[list[float]] = field(default_factory=list)
    looks: list[float] = field(default_factory=list)
    objectives: list[list[float]] = field(default_factory=list)


@dataclass(frozen=True)
class Proposal:
    """Parameters X proposed for the next run of a material, with the statistics that the surrogate predicts.

    Attributes
    ----------
    parameters : list of float
        Proposed X.
    mode : {'exploit', 'explore', 'exhausted', 'ended'}
        Reason for the proposal. ``exploit``: best predicted X. ``explore``: X that may be best within the surrogate's
        uncertainty. ``exhausted``: best verified X, because all combinations of whole-number parameters have been
        simulated. ``ended``: best verified X, because the material needs no further run.
    looks : float or None
        Effective number of looks proposed with X.
    cost : float or None
        Cost that the surrogate predicts at the proposal, in the unit of the objective.
    floor : float or None
        Smallest cost inside the bounds if the surrogate's statistics may err by two standard errors towards the target;
        None if it was not searched for.
    nsga2_cost : float or None
        Predicted cost of NSGA-II's best point, before the least-squares fit.
    statistics, errors : list of list of float
        Statistics predicted at the proposal, and their kriging standard deviations, shape (n, 3).
    q2 : list of float or None
        Leave-one-out Q2 of the surrogate for mean, log sd and skewness; None if it is undefined, as for a single run.
    front : Front
        Front of the search; empty if there is one objective.
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
    front: Front = field(default_factory=Front)


@dataclass(frozen=True)
class PassScore:
    """Density of a material in one pass of a run.

    Attributes
    ----------
    dp : list of float
        Skew-normal parameters xi [dB], omega [dB] and alpha.
    rms : float
        Root-mean-square difference between the density and the target's density in the same pass [1/dB].
    """

    dp: list[float]
    rms: float


@dataclass(frozen=True)
class Score:
    """Score of one material in one run, over all passes; X is the same in every pass.

    Attributes
    ----------
    parameters : list of float
        Parameters X of the material in the run.
    densities : list of PassScore or None
        Density of the material's pixels in each pass, with texture that lowers their effective number of looks to
        ``looks``; None for a pass with too few pixels of the material.
    statistics : list of list of float
        Mean [dB], log sd and skewness of each incidence-angle bin, at the sensor's looks, shape (n, 3); the bins of all
        passes follow one another. The objective ``density`` has one row for each pass.
    looks : float
        Effective number of looks with which the run fits the target best.
    cost : float
        Value of the quantity that the objective minimises.
    own_law : bool
        Whether the run used the material's calibrated law. A run with another law gives only the score at the start of
        the calibration.
    gain : float or None
        Decrease from the smallest verified cost to the smallest cost that the surrogate of all runs predicts, after an
        infill run, or to that of :meth:`radcal.proposals.search.Search.without_trend`, if it is smaller; None for an
        objective whose stop criterion does not use it.
    floor : float or None
        Smallest cost if the statistics of the surrogate of all runs may err by two standard errors towards the target;
        None if it was not searched for.
    moved_db : float or None
        Largest difference over the incidence seen between the laws of the best verified and the best predicted X [dB].
    """

    parameters: list[float]
    densities: list[PassScore | None]
    statistics: list[list[float]]
    looks: float
    cost: float
    own_law: bool = True
    gain: float | None = None
    floor: float | None = None
    moved_db: float | None = None

    @property
    def dp(self) -> list[float]:
        """Direct parameters xi, omega and alpha of the run's density in the first pass."""
        return self._first.dp

    @property
    def rms(self) -> float:
        """Rms difference of the run's density from the target's in the first pass [1/dB]."""
        return self._first.rms

    @property
    def _first(self) -> PassScore:
        first = self.densities[0]
        assert first is not None  # noqa: S101 - the first pass shows all materials
        return first


@dataclass(frozen=True)
class Run:
    """Run of a calibration, with the score of each calibrated material.

    Attributes
    ----------
    kind : {'reference', 'registration', 'reused', 'design', 'infill'}
        Kind of the run. The measured image is registered again onto the image of the registration run. Reused runs come
        from an earlier case. Registration run and reused runs train the surrogate and do not count towards
        ``stop.max_runs``.
    index : int
        Number of the run among the runs of its kind; of an infill run, the number of its iteration.
    keys : list of str
        Hashes that identify the run's record in each pass.
    seconds : float
        Wall time of the simulator [s].
    scores : mapping
        Score by material.
    proposals : mapping
        Proposal by material, for an infill run.
    repeat_db : float or None
        Largest difference of a pixel between a repeated reference run and the first one [dB]; None for other runs.
    repeat_variance : mapping by material
        Variance of the statistics among runs of equal parameters, shape (n, 3), from a repeated reference run that
        differs from the first one.
    rms_sampling : mapping by material
        Sampling error of the target's density, as rms [1/dB]; only the first reference run holds it.
    """

    kind: Kind
    index: int
    keys: list[str]
    seconds: float
    scores: Mapping[str, Score]
    proposals: Mapping[str, Proposal] = field(default_factory=dict)
    repeat_db: float | None = None
    repeat_variance: Mapping[str, list[list[float]]] = field(default_factory=dict)
    rms_sampling: Mapping[str, float] = field(default_factory=dict)


class History:
    """Scored runs in the order in which they were made.

    Parameters
    ----------
    runs : iterable of Run
        Reference runs, registration run, reused runs, design runs and infill runs, in this order.
    """

    def __init__(self, runs: Iterable[Run]) -> None:
        self.runs: Sequence[Run] = tuple(runs)

    @property
    def infill(self) -> list[Run]:
        """Infill runs, each of which verifies proposals of the optimiser."""
        return [run for run in self.runs if run.kind == "infill"]

    @property
    def iterations(self) -> int:
        """Number of iterations, each of which has made one or several infill runs."""
        return len({run.index for run in self.infill})

    @property
    def repeat_db(self) -> list[float]:
        """Largest pixel difference between each repeated reference run and the first reference run [dB]."""
        return [run.repeat_db for run in self.runs if run.repeat_db is not None]

    def rms_sampling(self, material: str) -> float:
        """Sampling error of the density of a material's target, as rms [1/dB]; 0 if no run holds it."""
        return max((run.rms_sampling.get(material, 0.0) for run in self.runs), default=0.0)

    def noise_variance(self, material: str) -> NDArray[np.float64] | None:
        """Variance of the statistics among runs of equal parameters, shape (n, 3); None if it was not measured."""
        found = [run.repeat_variance[material] for run in self.runs if material in run.repeat_variance]
        return np.mean(found, axis=0) if found else None

    def count(self, kind: Kind) -> int:
        """Return the number of runs of a kind."""
        return sum(run.kind == kind for run in self.runs)

    def best(self, material: str) -> Score:
        """Return a material's score in its best run."""
        return self.best_run(material).scores[material]

    def best_run(self, material: str) -> Run:
        """Return the earliest run with the smallest cost of a material, among runs with its calibrated law."""
        return min(self._of_law(material), key=lambda run: run.scores[material].cost)

    def _of_law(self, material: str) -> list[Run]:
        """Runs with a material's calibrated law, without repetitions, which have a single draw of speckle."""
        return [run for run in self.runs if run.scores[material].own_law and run.repeat_db is None]

    def failures(self, material: str) -> int:
        """Return the number of iterations with verified proposals of a material since that of its best run."""
        best = self.best_run(material)
        last = best.index if best.kind == "infill" else -1
        return len({run.index for run in self.infill if run.index > last and run.proposals[material].mode != "ended"})

    def training(self, material: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Training data of a material's surrogate: distinct parameters X, and the statistics of their runs.

        Returns
        -------
        parameters : ndarray, shape (k, d)
        statistics : ndarray, shape (k, n, 3)
            Mean [dB], log sd and skewness of each incidence-angle bin. Of several runs with the same X, the latest run
            counts, because the laws of neighbouring materials are then closest to their final ones.
        """
        seen: dict[tuple[float, ...], list[list[float]]] = {}
        for score in (run.scores[material] for run in self._of_law(material)):
            seen[tuple(score.parameters)] = score.statistics
        return np.array(list(seen)), np.array(list(seen.values()))

    def surprise(self, material: str) -> NDArray[np.float64]:
        """Ratio of the mean squared error of verified predictions to the predicted kriging variance.

        Squared errors and variances are summed over all verified proposals and incidence-angle bins. The variance of
        the noise of the runs, if it was measured, is subtracted from the squared errors. Proposals that repeat a run,
        or whose predicted errors are all 0 (as after a single run), do not count.

        Returns
        -------
        ndarray, shape (3,)
            Ratio for mean, log sd and skewness; 1 for a statistic without predicted errors.

        References
        ----------
        Bastos and O'Hagan, "Diagnostics for Gaussian process emulators", Technometrics 51 (2009), section 3: errors of
        validation runs over their predicted standard deviations.
        """
        pairs, known = [], set()
        for run in self.runs:
            score, one = run.scores[material], run.proposals.get(material)
            x = tuple(score.parameters)
            if one and one.mode in ("exploit", "explore") and np.any(one.errors) and x not in known:
                pairs.append((one, score))
            if score.own_law:
                known.add(x)
        if not pairs:
            return np.ones(3)
        noise = self.noise_variance(material)
        square = sum((np.array(score.statistics) - np.array(one.statistics)) ** 2 for one, score in pairs)
        square = square - (0.0 if noise is None else len(pairs) * noise)
        stated = np.sum([np.square(one.errors).sum(axis=0) for one, _ in pairs], axis=0)
        found = np.maximum(np.asarray(square).sum(axis=0), 0.0) / np.where(stated > 0.0, stated, np.nan)
        return np.where(np.isfinite(found), found, 1.0)


def write_runs(path: str | Path, runs: Iterable[Run]) -> None:
    """Write scored runs as JSON."""
    write_json(path, [asdict(run) for run in runs])


def read_runs(paths: Iterable[str | Path]) -> History:
    """Read scored runs from several JSON files, in the order of the files."""
    runs: list[Run] = []
    for path in paths:
        entries = read_json(path)
        with understood(path):
            runs += from_json(list[Run], [_of_passes(data) for data in entries], path)
    return History(runs)


def read_search(scores: str | Path, verified: Sequence[str]) -> History:
    """Read the scored runs of a search: its scores, and all iterations up to the last that ``verified`` names.

    A job of the loop has the last iteration alone as input, which depends on those before it, because a workflow in
    which each iteration named all earlier ones would be planned in quadratic time.
    """
    last = [Path(path) for path in verified[-1:]]
    numbered = [path.parents[1] / str(k) / path.name for path in last for k in range(int(path.parent.name) + 1)]
    return read_runs([scores, *numbered])


def _of_passes(run: dict[str, Any]) -> dict[str, Any]:
    """Entry of a run with lists of the passes; an earlier version of radcal kept the first pass apart."""
    if "key" in run:
        run["keys"] = [run.pop("key"), *run.pop("further_keys", [])]
        for score in run["scores"].values():
            score["densities"] = [{key: score.pop(key) for key in ("dp", "rms")}, *score.pop("further", [])]
    return run


def write_proposals(path: str | Path, proposals: Iterable[Mapping[str, Proposal]]) -> None:
    """Write the proposals of all materials for the runs of an iteration as JSON."""
    write_json(path, [{name: asdict(proposal) for name, proposal in one.items()} for one in proposals])


def read_proposals(path: str | Path) -> list[dict[str, Proposal]]:
    """Read the proposals of all materials for the runs of an iteration from a file of :func:`write_proposals`."""
    found = read_json(path)  # an earlier version of radcal wrote the proposals of its one run alone
    return from_json(list[dict[str, Proposal]], [found] if isinstance(found, dict) else found, path)

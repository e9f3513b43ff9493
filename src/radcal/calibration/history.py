"""The runs of a calibration in order, each scored against the targets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.class_surrogate import ClassRuns
from radcal.measurement.levels import Levels
from radcal.storage.records import read_json, write_json
from radcal.storage.runs import Parameters, Record

if TYPE_CHECKING:
    from radcal.calibration.class_search import ClassSearch
    from radcal.measurement.target import Targets

__all__ = [
    "History",
    "Proposal",
    "Run",
    "read_proposals",
    "read_runs",
    "score",
    "write_proposals",
    "write_runs",
]

Kind = Literal["reference", "reused", "design", "infill"]


@dataclass(frozen=True)
class Proposal:
    """Where a material goes next, and what its surrogate promises there.

    Attributes
    ----------
    parameters : list of float
        Proposed X.
    mode : {'exploit', 'explore', 'exhausted', 'ended'}
        Best predicted point; point that could be best at the surrogate's accuracy; the
        verified best where every combination of whole parameters has been simulated, or of a
        material that needs no further run.
    predicted_rms : float or None
        Density rms that the surrogate predicts at the proposal [1/dB].
    floor_rms : float or None
        The smallest rms anywhere in the box, two standard errors of the surrogate in
        favour [1/dB]; None where the search for it was not needed.
    nsga2_rms : float or None
        Predicted rms of NSGA-II's best point, before any polish [1/dB].
    looks : float or None
        Effective looks proposed with X, where classes of incidence are what is minimised.
    predicted_cost : float or None
        Half the sum of squared residuals that is promised there.
    """

    parameters: list[float]
    mode: Literal["exploit", "explore", "exhausted", "ended"]
    predicted_rms: float | None = None
    floor_rms: float | None = None
    nsga2_rms: float | None = None
    looks: float | None = None
    predicted_cost: float | None = None


@dataclass(frozen=True)
class Run:
    """A run and its score per calibrated material.

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
    parameters, dp, rms : mapping by material
        X; xi [dB], omega [dB], alpha of the simulated density; its rms [1/dB].
    proposals : mapping by material
        What was promised, for infill runs.
    other_law : list of str
        Materials that this run gave another law than the one that is calibrated: its X is none of
        theirs, and it counts for nothing but the score at the start.
    repeat_db : float or None
        For a repeated reference run: largest difference of its pixels from the first's [dB].
    repeat_variance : mapping by material
        For one that differs: variance among runs of equal parameters of mean [dB2], log standard
        deviation and skewness.
    cumulants : mapping by material
        Where classes of incidence are what is minimised: mean [dB], variance [dB2] and third central
        moment [dB3] of each class, at the sensor's looks. ``dp`` and ``rms`` are then those with texture of
        the material's own looks.
    looks, cost : mapping by material
        The effective looks that suit the run best, and half the sum of squared residuals there.
    rms_sampling : mapping by material
        For the reference run: density rms of a sample as large as the target's [1/dB].
    left, moved_db : mapping by material
        For infill: what the run's own correction would still take from the cost, and by how much the law
        would change on the way [dB] (:meth:`radcal.calibration.class_search.ClassSearch.left`).
    """

    kind: Kind
    index: int
    key: str
    seconds: float
    parameters: Mapping[str, list[float]]
    dp: Mapping[str, list[float]]
    rms: Mapping[str, float]
    proposals: Mapping[str, Proposal] = field(default_factory=dict)
    other_law: list[str] = field(default_factory=list)
    repeat_db: float | None = None
    repeat_variance: Mapping[str, list[float]] = field(default_factory=dict)
    cumulants: Mapping[str, list[list[float]]] = field(default_factory=dict)
    rms_sampling: Mapping[str, float] = field(default_factory=dict)
    looks: Mapping[str, float] = field(default_factory=dict)
    cost: Mapping[str, float] = field(default_factory=dict)
    left: Mapping[str, float] = field(default_factory=dict)
    moved_db: Mapping[str, float] = field(default_factory=dict)


def score(
    kind: Kind,
    index: int,
    record: Record,
    parameters: Parameters,
    targets: Targets,
    proposals: Mapping[str, Proposal] | None = None,
    other_law: Sequence[str] = (),
    searches: Mapping[str, ClassSearch] | None = None,
) -> Run:
    """Score a record against the targets.

    Parameters
    ----------
    kind, index
        As in :class:`Run`.
    record : Record
        The run.
    parameters : mapping
        X by material.
    targets : Targets
        By calibrated material.
    proposals, other_law
        As in :class:`Run`.
    searches : mapping, optional
        What judges classes of incidence, by material.
    """
    pixels_db = dict(record.pixels_db)
    mapping = targets.levels.simulated(record.pixels_db)
    cumulants, looks, cost, left, moved = {}, {}, {}, {}, {}
    for name, search in (searches or {}).items():
        if name in other_law:
            continue
        found = search.classes.cumulants(Levels.apply(record.pixels_db[name][targets[name].order], mapping))
        cumulants[name] = found.tolist()
        looks[name], cost[name] = search.score(parameters[name], found)
        if kind == "infill":
            left[name], moved[name] = search.left(parameters[name], looks[name], found)
        pixels_db[name] = search.textured(record.pixels_db[name], looks[name])
    scored = targets.score(pixels_db)
    return Run(
        kind=kind,
        index=index,
        key=record.key,
        seconds=record.seconds,
        parameters={name: [float(x) for x in parameters[name]] for name in targets},
        dp={name: [float(v) for v in dp] for name, (dp, _) in scored.items()},
        rms={name: rms for name, (_, rms) in scored.items()},
        proposals=proposals or {},
        other_law=list(other_law),
        cumulants=cumulants,
        looks=looks,
        cost=cost,
        left=left,
        moved_db=moved,
    )


class History:
    """Scored runs in the order they were made.

    Parameters
    ----------
    runs : iterable of Run
        Reference, reused, design, then infill.
    """

    def __init__(self, runs: Iterable[Run]) -> None:
        self.runs: Sequence[Run] = tuple(runs)

    @property
    def infill(self) -> list[Run]:
        """The verified proposals."""
        return [run for run in self.runs if run.kind == "infill"]

    @property
    def repeat_db(self) -> list[float]:
        """Largest difference of each repeated reference run's pixels from the first's [dB]."""
        return [run.repeat_db for run in self.runs if run.repeat_db is not None]

    def rms_sampling(self, material: str) -> float:
        """Density rms of a sample as large as the material's target [1/dB], 0 where it was not recorded."""
        return max((run.rms_sampling.get(material, 0.0) for run in self.runs), default=0.0)

    def noise_variance(self, material: str) -> NDArray[np.float64] | None:
        """Variance of mean [dB2], log sd and skewness among runs of equal parameters, None where not measured."""
        found = [run.repeat_variance[material] for run in self.runs if material in run.repeat_variance]
        return np.mean(found, axis=0) if found else None

    def count(self, kind: Kind) -> int:
        """Return the number of runs of a kind."""
        return sum(run.kind == kind for run in self.runs)

    def best(self, material: str) -> Run:
        """Return the run with the material's smallest cost, the earliest of equals, made with its law.

        The cost is the rms, or that of the classes of incidence where these are what is minimised.
        """
        own = (run for run in self.runs if material not in run.other_law)
        return min(own, key=lambda run: run.cost.get(material, run.rms[material]))

    def failures(self, material: str) -> int:
        """Return the number of verified proposals since the best one (or since the design)."""
        best = self.best(material)
        since = self.infill if best.kind != "infill" else self.infill[self.infill.index(best) + 1 :]
        return sum(run.proposals[material].mode != "ended" for run in since)

    @property
    def of_classes(self) -> bool:
        """Whether classes of incidence are what is minimised."""
        return any(run.cost for run in self.runs)

    def class_training(self, material: str) -> ClassRuns:
        """Distinct parameters and the cumulants of their classes: of infill, where there is any.

        In reference and design the neighbours have laws at random, whose echo in a material's pixels may outweigh
        its own; in infill they are nearly right, in the latest run of a repeated X most so.
        """
        seen: dict[tuple[float, ...], list[list[float]]] = {}
        for run in self.infill or self.runs:
            if material not in run.other_law:
                seen[tuple(run.parameters[material])] = run.cumulants[material]
        return ClassRuns(np.array(list(seen)), np.array(list(seen.values())))

    def training(self, material: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distinct parameters and their densities.

        Returns
        -------
        parameters : ndarray, shape (n, d)
        dp : ndarray, shape (n, 3)
            xi [dB], omega [dB], alpha.
        """
        # a material that has ended repeats its X while others go on; its density may differ in
        # rounding with its neighbours' laws, and kriging wants each point once
        seen: dict[tuple[float, ...], list[float]] = {}
        for run in self.runs:
            if material in run.other_law:
                continue
            seen.setdefault(tuple(run.parameters[material]), list(run.dp[material]))
        return np.array(list(seen)), np.array(list(seen.values()))


def write_runs(path: str | Path, runs: Iterable[Run]) -> None:
    """Write scored runs as JSON."""
    write_json(path, [asdict(run) for run in runs])


def read_runs(paths: Iterable[str | Path]) -> History:
    """Read scored runs from files, in the order of the files."""

    def parse(data: dict[str, Any]) -> Run:
        proposals = {name: Proposal(**item) for name, item in data.pop("proposals").items()}
        return Run(**data, proposals=proposals)

    return History(parse(data) for path in paths for data in read_json(path))


def write_proposals(path: str | Path, proposals: Mapping[str, Proposal]) -> None:
    """Write proposals as JSON."""
    write_json(path, {name: asdict(proposal) for name, proposal in proposals.items()})


def read_proposals(path: str | Path) -> dict[str, Proposal]:
    """Read proposals that :func:`write_proposals` wrote."""
    return {name: Proposal(**data) for name, data in read_json(path).items()}

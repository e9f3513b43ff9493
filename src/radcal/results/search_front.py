"""Part of the archive that contains the front of a search with several objectives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.objectives import Comparison
from radcal.objectives.history import History

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class SearchFront:
    """Front of NSGA-II in the last search for a material: f points with p objectives, and the objectives of n runs.

    Attributes
    ----------
    objectives : tuple of str
        Names of the sums of squared residuals that NSGA-II minimises as objectives.
    predicted : ndarray of float64, shape (f, p)
        Objectives of the points of the front, predicted by the last surrogate.
    verified : ndarray of float64, shape (n, p)
        Objectives of each run; NaN for a run with another law.
    """

    objectives: tuple[str, ...]
    predicted: Doubles
    verified: Doubles


def search_fronts(objectives: Mapping[str, Comparison], history: History) -> dict[str, SearchFront]:
    """Front of the last search of each material; materials whose search has a single objective are left out.

    Parameters
    ----------
    objectives : mapping
        Objective by calibrated material.
    history : History
        All scored runs.
    """
    last = {}
    for run in history.infill:
        last.update({name: proposal.front for name, proposal in run.proposals.items() if proposal.front.objectives})
    found = {}
    for name, front in last.items():
        comparison = objectives[name]
        nothing = np.full(len(comparison.part_names), np.nan)
        scores = [run.scores[name] for run in history.runs]
        found[name] = SearchFront(
            objectives=tuple(comparison.part_names),
            predicted=np.array(front.objectives),
            verified=np.array([comparison.parts_of(score) if score.own_law else nothing for score in scores]),
        )
    return found

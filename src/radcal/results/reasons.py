"""Texts for the reasons why a calibration ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Words:
    """Texts for one reason why a calibration ended, for different places in the report.

    Attributes
    ----------
    clause : str
        Clause that ends a sentence such as "Stopped after 30 runs with dyke outside the tolerance: ...".
    cell : str
        Entry in the table of materials.
    label : str
        Label after the rms of a material in a figure.
    met : bool
        Whether the calibration ended because the tolerance or the stop criterion was met.
    """

    clause: str
    cell: str
    label: str
    met: bool = False


REASONS: Mapping[str, Words] = {
    "rms": Words("within the tolerance", "tolerance reached", "converged", met=True),
    "settled": Words("the stop criterion is met", "stop criterion met", "stop criterion met", met=True),
    "unreachable": Words("no parameters inside the bounds seem to reach the target", "unreachable", "unreachable"),
    "stagnation": Words("no longer getting better", "stagnation", "stagnated"),
    "max_runs": Words("maximum number of runs", "maximum of runs", "out of runs"),
    "max_hours": Words("maximum time of the simulator", "maximum of time", "out of time"),
    "running": Words("not finished", "not finished", "unfinished"),
}
"""Texts for each :data:`radcal.calibration.stopping.Reason`, and for ``running``, a calibration that has not ended."""

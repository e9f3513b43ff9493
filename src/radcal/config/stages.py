"""Table of the workflow's stages: what each reads of the configuration, makes, says and requests.

The rule of a stage takes outputs, message, resources and ``params`` from the stage's row in :data:`STAGES`. The
``params`` contain the configuration sections that the stage reads, from which its job makes a :class:`Part` with these
sections alone (:func:`radcal.session.jobs.job`): a function that reads another section fails. A job runs again when one
of its sections has changed (``docs/reruns.md``).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from pydantic import create_model

from radcal.config.case import Case
from radcal.config.part import Part


@cache
def model_of(*names: str) -> type[Part]:
    """Model of a part of the configuration: the fields of :class:`Case` with the given names."""
    fields: dict[str, Any] = {name: (one.annotation, one) for name, one in Case.model_fields.items() if name in names}
    return create_model("Part", __base__=Part, **fields)


@dataclass(frozen=True)
class Demand:
    """Memory and time that a job requests from a cluster, as linear functions of the number of values in its arrays.

    Attributes
    ----------
    base_mb, value_bytes : float
        Constant memory [MB], and memory for each value [byte].
    million_s : float
        Time for a million values [s], without simulator runs.
    least_min : int
        Constant time [min].
    """

    base_mb: float
    value_bytes: float = 0.0
    million_s: float = 0.0
    least_min: int = 10


# The coefficients exceed those measured on scenes of 2 to 56 million cells (docs/cluster.md).
_LIGHT = Demand(1000)
_SEARCH = Demand(1000, least_min=60)
_SCENE = Demand(600, 80, 10)
_GEOMETRY = Demand(800, 100, 30)
_STRIP = Demand(1000, 200, 60)
_IMAGE = Demand(900, 180, 60)
_RUN = Demand(1000, 100, 30)
_REGISTRATION = Demand(1000, 350, 200)
_PAGE = Demand(1000, 100, 20)

_PASS = ("radars", "materials")
_LAWS = ("seed", *_PASS)
_RUNS = (*_LAWS, "simulator")  # what determines the pixel values of runs
_TARGET = (*_RUNS, "objective", "target", "validation")
_TRAIN = (*_RUNS, "objective", "surrogate")
# sections that no calibration reads
_PRODUCTS = ("gmti", "ppi", "signals")
_ARCHIVE = tuple(name for name in Case.model_fields if name not in ("replace", "products", *_PRODUCTS))
FORWARD = ("case", "scene", *_PRODUCTS, *_RUNS)
"""Sections that a forward run reads."""


@dataclass(frozen=True)
class Stage:
    """Stage of the workflow: what its rule reads of the configuration, makes, says and requests from a cluster.

    Attributes
    ----------
    words : str
        Name of the stage in messages, with the wildcards of its outputs.
    reads : tuple of str
        Fields of :class:`Case` that the stage reads.
    demand : Demand
        Resources of a job.
    outputs : mapping of str to str
        Files and folders below ``results/<case>``, by their names in the rule. A wildcard stands for the number of the
        pass (``{p}``), of the strip (``{s}``), of the part of the design (``{chunk}``), of the iteration (``{k}``) or
        of its run (``{j}``), or for the name of a calibrated material (``{material}``).
    schemas : mapping of str to int
        Schema number of the layout of each kind of HDF5 file among the outputs.
    only_if : callable, optional
        Function ``case -> bool``: whether a finished case has the outputs. By default every case has them.
    """

    words: str
    reads: tuple[str, ...]
    demand: Demand
    outputs: Mapping[str, str]
    schemas: Mapping[str, int] = field(default_factory=dict)
    only_if: Callable[[Case], bool] | None = None

    @property
    def model(self) -> type[Part]:
        """Model of the part of the configuration that the stage reads."""
        return model_of(*self.reads)

    def of(self, case: Part) -> Part:
        """Part of a case that the stage reads."""
        return self.model.of(case)

    def params(self, case: Case) -> dict[str, Any]:
        """Sections of a case that the stage reads, as plain data for its model."""
        return case.sections(*self.reads)

    def is_needed(self, case: Case) -> bool:
        """Whether a finished case has the outputs of the stage."""
        return self.only_if is None or self.only_if(case)

    def files(self, case: Case, iterations: int = 0) -> list[str]:
        """Outputs of all jobs of the stage in a case, below ``results/<case>``."""
        values = {
            "p": range(1, len(case.passes) + 1),
            "chunk": range(len(case.passes) * case.design_parts),
            "material": case.calibrated,
            "k": range(iterations),
            "j": range(case.infill.batch),
        }
        found = []
        for path in self.outputs.values():
            names = [name for name in values if f"{{{name}}}" in path]
            for each in itertools.product(*(values[name] for name in names)):
                found.append(path.format(**dict(zip(names, each, strict=True))))
        return found


def _twice(case: Case) -> bool:
    return case.registers_twice


def _never(_: Case) -> bool:
    """For files that are removed when they have been used, or made on demand."""
    return False


# fmt: off
STAGES: Mapping[str, Stage] = {
    "scene": Stage("scene", ("scene", "materials"), _SCENE, {"scene": "scene.h5"}, {"scene": 2}),
    "frame": Stage(
        "frame of the strips", ("radars",), _SCENE, {"frame": "passes/{p}/frame.json"}, only_if=_never),
    "strip": Stage(
        "strip {s} of the geometry", ("radars",), _STRIP, {"strip": "passes/{p}/strips/{s}.h5"}, only_if=_never),
    "geometry": Stage(
        "geometry of the pass", ("radars",), _GEOMETRY, {"geometry": "passes/{p}/geometry.h5"}, {"geometry": 5}),
    # radcal's own simulator has no files or settings that change its numbers
    "simulator": Stage(
        "simulator", (*_PASS, "simulator"), _RUN, {"identity": "passes/{p}/simulator.json"},
        only_if=lambda case: not case.simulator.own),
    "measurement": Stage(
        "measured image", (*_PASS, "simulator", "measurements", "target"), _IMAGE,
        {"measurement": "passes/{p}/measurement.h5"}, {"measurement": 2}),
    "reuse": Stage(
        "runs of an earlier case", _RUNS, _RUN, {"index": "reused.json"},
        only_if=lambda case: case.design.reuse is not None),
    "reference_run": Stage("reference run", _RUNS, _RUN, {"index": "passes/{p}/reference.json"}),
    "first_registration": Stage(
        "first registration", (*_PASS, "registration"), _REGISTRATION,
        {"registered": "passes/{p}/first/registered.h5"}, only_if=_twice),
    "laws_of_image": Stage(
        "laws for the registration run", _TARGET, _IMAGE, {"laws": "laws_of_image.json"}, only_if=_twice),
    "registration_run": Stage(
        "registration run", _RUNS, _RUN, {"index": "passes/{p}/registration_run.json"}, only_if=_twice),
    "registration": Stage(
        "registration", (*_PASS, "registration"), _REGISTRATION,
        {"registered": "passes/{p}/registered.h5"}, {"registered": 4}),
    "target": Stage("target densities", _TARGET, _IMAGE, {"target": "passes/{p}/target.h5"}, {"target": 6}),
    "design_chunk": Stage("design, chunk {chunk}", (*_RUNS, "design"), _RUN, {"index": "design/{chunk}.json"}),
    "scores": Stage("scores of the design", (*_LAWS, "objective"), _LIGHT, {"scores": "scores.json"}),
    "train": Stage("train {k}", _TRAIN, _SEARCH, {"surrogate": "iterations/{k}/surrogate.h5"}, {"surrogate": 6}),
    "propose": Stage(
        "propose {k}", (*_LAWS, "objective", "optimiser", "infill"), _SEARCH,
        {"proposal": "iterations/{k}/proposal.json"}),
    # a single run is made by verify itself
    "infill_run": Stage(
        "infill run {k}.{j}", _RUNS, _RUN, {"index": "iterations/{k}/runs/{j}.json"},
        only_if=lambda case: case.infill.batch > 1),
    "verify": Stage(
        "verify {k}", _TRAIN, _RUN,
        {"verified": "iterations/{k}/verified.json", "trained": "iterations/{k}/verified/surrogate.h5"}),
    "final_runs": Stage("final runs", _RUNS, _RUN, {"final": "final.json"}),
    "posterior": Stage(
        "posterior of all laws", (*_TARGET, "surrogate", "uncertainty"), _RUN,
        {"image": "image.h5", "posterior": "posterior/{material}.h5"}, {"image": 5, "posterior": 6}),
    "archive": Stage(
        "archive of all runs and exports", _ARCHIVE, _REGISTRATION,
        {
            "archive": "calibration.h5", "table": "runs.csv", "checksum": "table.json", "stop": "stop.json",
            "folder": "export", "exported": "export.json",
        },
        {"calibration": 15}),
    "products": Stage("products", (*FORWARD, "products"), _IMAGE, {"made": "products.json"}, only_if=_never),
    "report": Stage(
        "figures, report and summary", (), _PAGE,
        {"figures": "figures", "page": "report.html", "checksums": "report.json", "summary": "summary.json"}),
}
# fmt: on
"""Stages of the workflow, by the names of their rules, in the order of the flow."""

OUTPUTS = [path for stage in STAGES.values() for path in stage.outputs.values()]
"""Outputs of all stages below ``results/<case>``, with wildcards in braces."""

SCHEMAS: Mapping[str, int] = {kind: number for stage in STAGES.values() for kind, number in stage.schemas.items()} | {
    "run": 2,  # of the run store, no rule's output
    "signal_part": 1,  # of a product that is being made; raised when the signal of the same settings changes
}
"""Schema number of the layout of each kind of HDF5 file, by the name of the kind."""

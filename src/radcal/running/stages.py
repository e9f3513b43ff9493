"""Sections of the configuration that each rule reads, and the table of jobs and runs that a change of each repeats.

The rules take their ``params`` from here, and the table of ``docs/reruns.md`` is written from it:
``python -m radcal.running.stages``.
"""

from __future__ import annotations

from collections.abc import Mapping

from radcal.config import Case

__all__ = ["NOT_IN_JOBS", "READS", "reruns_table"]

NOT_IN_JOBS = ("replace",)
"""Keys that no job's results depend on."""

# sections that determine the numbers of a run
_SIMULATION = ("seed", "radar", "simulator", "materials")

READS: Mapping[str, tuple[str, ...]] = {
    "scene": ("scene", "materials"),
    "geometry": ("radar",),
    "simulator": ("simulator", "materials", "radar"),
    "measurement": ("measurement", "materials", "radar", "simulator", "target"),
    "reuse": _SIMULATION,
    "reference_run": _SIMULATION,
    "registration": ("registration", "materials"),
    "target": ("seed", "materials", "radar", "simulator", "objective", "target", "validation"),
    "design_chunk": (*_SIMULATION, "objective", "design"),
    # the objective is read from the targets' file
    "scores": ("seed", "materials", "radar"),
    "train": ("simulator", "materials", "surrogate"),
    "propose": ("seed", "materials", "radar", "optimiser"),
    "verify": _SIMULATION,
    "stop_settings": ("stop",),
    "final_runs": _SIMULATION,
    # the stop settings are read from a file
    "archive": tuple(key for key in Case.model_fields if key not in ("stop", *NOT_IN_JOBS)),
}
"""Rule to the sections of the configuration that its jobs read: a job runs again when one of them changes."""

_RUNS: Mapping[str, str] = {
    "case": "all, in `results/<case>`; `design.reuse` takes those of another case",
    "replace": "none",
    "seed": "all, because design and speckle change",
    "scene": "all, where the scene differs",
    "radar": "all; none for `looks`, `nesz_db` and resolutions where an external program does not receive them",
    "simulator": "none for `keep_images`; all where the simulator's identity changes (its program, its files)",
    "materials": "those with changed parameters: a new start is a new reference run, new bounds are a new design; "
    "all for a new law or another material's parameters",
    "measurement": "none of the design; infill towards the new target",
    "registration": "none of the design; infill towards the new target",
    "objective": "those by which the design of the density is larger; infill for the new objective",
    "target": "none of the design; infill towards the new target",
    "validation": "none of the design; infill towards the new target",
    "design": "those by which a larger design, or another sampler, differs",
    "surrogate": "none of the design; infill where the proposals differ",
    "optimiser": "none of the design; infill where the proposals differ",
    "stop": "none; more infill where the new settings ask for it",
}


def _first(section: str) -> list[str]:
    """Rules that read a section, except for the archive, which reads nearly all."""
    return [rule for rule, sections in READS.items() if section in sections and rule != "archive"]


def reruns_table() -> str:
    """Table of ``docs/reruns.md``: jobs and runs that a changed key makes again.

    Returns
    -------
    str
        Markdown, one line per key of the configuration.
    """
    lines = ["| key | stages that read it | new runs of the simulator |", "|---|---|---|"]
    for section in Case.model_fields:
        rules = ", ".join(_first(section)) or ("archive" if section in READS["archive"] else "none")
        lines.append(f"| `{section}` | {rules} | {_RUNS[section]} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(reruns_table(), end="")  # noqa: T201 - the table is what was asked for

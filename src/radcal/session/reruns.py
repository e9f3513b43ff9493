"""Table in ``docs/reruns.md``: simulator runs that follow a change of each configuration key.

``python -m radcal.session.reruns`` prints it.
"""

from __future__ import annotations

from collections.abc import Mapping

from radcal.config import Case

_RUNS: Mapping[str, str] = {
    "case": "all, in `results/<case>`; `design.reuse` takes those of another case",
    "replace": "none",
    "seed": "all, because design and speckle change",
    "scene": "all, where the scene differs",
    "radar": "all; none for `looks`, `nesz_db` and resolutions where an external program does not receive them",
    "simulator": "none for `keep_images`; all where the simulator's identity changes (its program, its files)",
    "materials": "those with changed parameters: a new start is a new reference run, new bounds are a new design; "
    "all for a new law or another material's parameters",
    "measurement": "none of the design; the registration run, and infill towards the new target",
    "registration": "none of the design; the registration run, and infill towards the new target",
    "objective": "further draws of speckle in the design where `simulator.draws` is not configured; infill for the new "
    "objective",
    "target": "none of the design, which is larger with normalisation `image` (`design.size: auto`); the registration "
    "run, and infill towards the new target",
    "validation": "none of the design; the registration run, and infill towards the new target",
    "design": "those by which a larger design, or another sampler, differs",
    "surrogate": "those by which the design without a baseline is larger (`design.size: auto`); infill where the "
    "proposals differ",
    "optimiser": "none of the design; infill where the proposals differ",
    "uncertainty": "none",
    "stop": "none; more infill where the new settings ask for it",
}


def reruns_table() -> str:
    """Table in ``docs/reruns.md``: simulator runs that follow a change of each configuration key.

    Returns
    -------
    str
        Table in Markdown, with the top-level keys of the configuration that a run or a result reads.
    """
    keys = [field.alias or name for name, field in Case.model_fields.items()]
    named = {text: [f"`{key}`" for key in keys if _RUNS.get(key) == text] for text in _RUNS.values()}
    lines = ["| key | new runs of the simulator |", "|---|---|"]
    return "\n".join(lines + [f"| {', '.join(names)} | {text} |" for text, names in named.items()]) + "\n"


if __name__ == "__main__":
    print(reruns_table(), end="")  # noqa: T201 - the module's output is the table

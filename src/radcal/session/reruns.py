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
    "simulator": "all where its program or files change; none for `keep_images`",
    "materials": "a reference run for a new start, a design for new bounds; all for a new law or another material's "
    "parameters",
    "measurement": "the registration run and infill",
    "registration": "the registration run and infill",
    "objective": "further draws of speckle in the design without `simulator.draws`; infill",
    "target": "the registration run and infill; a larger design with normalisation `image`",
    "validation": "the registration run and infill",
    "design": "those that the earlier design lacks",
    "surrogate": "infill where proposals differ; a larger design without a baseline",
    "optimiser": "infill where proposals differ",
    "infill": "infill where proposals differ",
    "uncertainty": "none",
    "stop": "more infill where the new settings ask for it",
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

"""Table of all runs, ``runs.csv``."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from radcal.results.archive import Archive
from radcal.storage.files import atomic


def write_table(path: str | Path, archive: Archive) -> None:
    """Write ``runs.csv`` with one line per run and material.

    Parameters
    ----------
    path : path
        Path of the file.
    archive : Archive
        Results of a calibration.
    """
    headings = [list(archive.configured.materials[name].parameter_names) for name in archive.materials]
    widest = max(headings, key=len)
    if any(heading != widest[: len(heading)] for heading in headings):  # materials of different laws
        widest = [f"X{k}" for k in range(1, len(widest) + 1)]
    runs = archive.runs
    with atomic(path) as partial, partial.open("w", newline="", encoding="utf-8") as handle:
        table = csv.writer(handle)
        table.writerow(["run", "kind", "index", "key", "seconds", "material", *widest, "xi", "omega", "alpha", "rms"])
        for n, (kind, index, key, seconds) in enumerate(
            zip(runs.kind, runs.index, archive.passes["1"].keys, runs.seconds, strict=True)
        ):
            row = [n, kind, int(index), key, f"{seconds:.3f}"]
            for name, material in archive.materials.items():
                x = ["" if np.isnan(v) else repr(float(v)) for v in material.parameters[n]]
                x += [""] * (len(widest) - len(x))
                dp = [repr(float(v)) for v in material.dp[n]]
                table.writerow([*row, name, *x, *dp, repr(float(material.rms[n]))])

"""Verdict, runs and files of a case, from its results folder."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radcal.config.stages import STAGES, Stage
from radcal.errors import StoreError
from radcal.findings import Finding
from radcal.forecast.runs_and_time import duration, runs_in_words
from radcal.products.opening import open_results
from radcal.results.law_notes import found_words
from radcal.storage.lock import holder
from radcal.storage.records import understood
from radcal.words import ENDINGS, beside_headline

_FILES = {"report.html": "report", "export": "exports", "summary.json": "summary", "runs.csv": "table of runs"}

_SEVERAL = re.compile("{(k|chunk|material)}")  # wildcards of files of which a pass has several
_AGAIN = "type the command that began the case again (radcal run with its YAML file): finished runs are kept"


def results_folder(case: str | Path, results: str | Path = "results") -> Path:
    """Results folder of a case.

    Parameters
    ----------
    case : str or path
        Results folder, case file (YAML), or name of a case.
    results : path
        Folder that contains the results folders of all cases.

    Raises
    ------
    ConfigError
        The case file is wrong.
    StoreError
        The results folder does not exist.
    """
    path = Path(case)
    if path.is_file():
        from radcal.config import load

        folder = Path(results) / load([path]).case
    else:
        named = Path(results) / path
        folder = named if len(path.parts) == 1 and (named.is_dir() or not path.is_dir()) else path
    if not folder.is_dir():
        raise StoreError(
            f"{case}: there is no folder {folder}, expected the name of a case that has been run, its results folder "
            "or its YAML file."
        )
    return folder


def show(folder: str | Path) -> list[str]:
    """Lines on the results of a case: verdict, materials, runs and files, or what is missing.

    Parameters
    ----------
    folder : path
        ``results/<case>``.

    Returns
    -------
    list of str
        The first line is the verdict on all materials, or says that the case is not finished.

    Raises
    ------
    StoreError
        ``summary.json`` cannot be read, or nothing in the folder is a result.
    """
    folder = Path(folder)
    if not any((folder / name).exists() for name in (".lock", "logs", "runs", "scene.h5", "summary.json")):
        raise StoreError(f"{folder}: holds no results, expected the results folder of a case.")
    missing = [stage for stage in STAGES.values() if stage.only_if is None and not _is_made(folder, stage)]
    there = [f"{title}: {folder / file}" for file, title in _FILES.items() if (folder / file).exists()]
    failed, running = _failure(folder), _running(folder)
    if all("{p}" in path for stage in missing for path in stage.outputs.values()):  # large files, deleted afterwards
        with understood(folder / "summary.json"):
            return [*_finished(open_results(folder).summary), *there, *failed, *running]
    kept = len(list((folder / "runs").glob("[!.]*.h5")))
    iterations = len(list((folder / "iterations").glob("*/verified.json")))
    lines = [f"{folder.name}: not finished; missing: {', '.join(stage.words for stage in missing)}."]
    lines.append(f"records of runs: {kept} in {folder / 'runs'}; iterations verified: {iterations}.")
    return [*lines, *there, *(running or failed or [f"To continue, {_AGAIN}."])]


def _is_made(folder: Path, stage: Stage) -> bool:
    """Whether the outputs of a stage exist, of those that every case has once or in its first pass."""
    paths = [path.format(p=1) for path in stage.outputs.values() if not _SEVERAL.search(path)]
    return all((folder / path).exists() for path in paths)


def _running(folder: Path) -> list[str]:
    """Lines on the command that is working on a case, and on its progress; empty if no command is working on it."""
    found = holder(folder)
    if found is None:
        return []
    place = "" if found.host == socket.gethostname() else f" on {found.host}"
    lines = [f"running now: process {found.process}{place}, for {duration(time.time() - found.since)}."]
    latest = max((folder / "logs").rglob("*.progress"), key=lambda path: path.stat().st_mtime, default=None)
    if latest is not None and latest.stat().st_mtime >= found.since:
        lines.append(f"last progress: {latest.read_text('utf-8', 'replace')}")
    return lines


def _failure(folder: Path) -> list[str]:
    """Lines on the failure that ended the last command on a case, and on what to type next; empty without failure."""
    try:
        message = (folder / "logs" / "failure.txt").read_text(encoding="utf-8").split("\n")[0].strip()
    except (OSError, ValueError):
        return []
    if not message:
        return []
    return [f"the last command failed: {message}", f"Once the cause is removed, {_AGAIN}."]


def _finished(summary: Mapping[str, Any]) -> list[str]:
    """Lines on verdict, parameters and runs of a finished calibration."""
    materials, runs = summary["materials"], summary["runs"]
    reused = f"; {runs['reused']} reused" if runs["reused"] else ""
    lines = [str(summary["verdict"])]
    for name, material in materials.items():
        interval = material["parameters_p05"], material["parameters_p95"]
        parameters = found_words(material["parameters"], material["bounds"], *interval)
        # in a case of one material, the first line is its verdict
        start = f"{material['verdict']}" if len(materials) > 1 else f"{name}:"
        law = material.get("formula", material["law"])
        lines.append(f"{start} {law} with {parameters}.")
        if (model := material["parameters_model"]) is not None:
            nearest = found_words(model, material["bounds"])
            lines.append(f"{name}: parameters_model, the law nearest to the median of the band: {nearest}.")
    findings = [Finding(**{key: one[key] for key in one if key != "text"}) for one in summary["findings"]]
    lines += beside_headline(summary["warnings"], findings)
    again = runs["registration"]
    others = runs_in_words({"reference": runs["reference"] - again, "registration": again, "final": runs["final"]})
    return [
        *lines,
        f"simulator runs of the search: {runs['search']} ({runs['design']} design, {runs['infill']} infill{reused}), "
        f"besides {others}; end: {ENDINGS[summary['stop_reason']]}.",
    ]

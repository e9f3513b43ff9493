"""Mutation run: small bugs put into copies of the package one at a time, each with the tests that should catch it.

``python tests/mutants/run.py`` runs all mutants of the tables beside this file (one table for each room of the
package), ``python tests/mutants/run.py radar scene`` those of two rooms, and ``--sample 6`` six that take seconds. A
mutant is caught if one of its tests fails. Outcomes are kept in ``.mutants/outcomes.json``, so that the same command
continues an interrupted run; a mutant is run again once its tests or the file that it changes are others.

Fields of a mutant: ``file`` (below the room), ``before`` (text that occurs once in the file), ``after`` (text in its
place), ``tests`` (files below ``tests/``, or tests in them: ``file::test``), ``reason`` (why no test can or should
catch the mutant), ``slow`` (true where the tests take more than a few seconds, so that samples leave the mutant out).
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")  # before numpy

# imported once here, and not again for each mutant, whose process is forked from this one; nothing of radcal
import h5py  # noqa: F401
import hypothesis  # noqa: F401
import numba
import numpy as np
import pydantic  # noqa: F401
import pytest
import scipy.ndimage
import scipy.stats  # noqa: F401

_numba: Any = numba.config  # its names are defined only at import
TABLES = Path(__file__).resolve().parent
TESTS = TABLES.parent
CHECKOUT = TESTS.parent
PACKAGE = CHECKOUT / "src" / "radcal"
WORKFLOW = ("Snakefile", "config", "profiles", "workflow")
OUTCOMES = CHECKOUT / ".mutants" / "outcomes.json"
CPU_S, TIMEOUT_S = 400, 900  # limits of a mutant's tests: loops and waits without an end are caught, too
PYTEST = ("-n", "0", "-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=0", "--no-header", "--tb=no")


@dataclass(frozen=True)
class Mutant:
    """Change of one file of the package.

    Attributes
    ----------
    room : str
        Package of radcal, which is the name of the table.
    file : str
        File below the room.
    before, after : str
        Text that occurs once in the file, and the text in its place.
    tests : tuple of str
        Files below ``tests/``, or single tests of them (``file::test``), that should catch the mutant.
    reason : str
        Why the mutant may survive; empty for a mutant that must be caught.
    slow : bool
        Whether the tests take too long for a sample.
    """

    room: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]
    reason: str = ""
    slow: bool = False

    @property
    def path(self) -> Path:
        """File of the package that the mutant changes."""
        return PACKAGE / self.room / self.file

    @property
    def source(self) -> str:
        """Text of the changed file; raises a SystemExit where the table does not fit the file."""
        text = self.path.read_text(encoding="utf-8")
        if text.count(self.before) != 1:
            sys.exit(
                f"{self.room}.toml: {self.before!r} occurs {text.count(self.before)} times in {self.file}, not once."
            )
        changed = text.replace(self.before, self.after)
        ast.parse(changed)
        return changed

    @property
    def key(self) -> str:
        """Hash of the changed file and of the tests."""
        files = {name.partition("::")[0] for name in self.tests}
        parts = [self.source, *self.tests, *((TESTS / name).read_text(encoding="utf-8") for name in sorted(files))]
        return hashlib.sha256("\0".join([self.room, self.file, *parts]).encode()).hexdigest()

    def __str__(self) -> str:
        """Line that shows the change."""
        return f"{self.room}/{self.file}: {' '.join(self.before.split())} -> {' '.join(self.after.split())}"


def mutants(rooms: Sequence[str]) -> Iterator[Mutant]:
    """Mutants of the given rooms' tables, or of all tables if no room is given."""
    for table in sorted(TABLES.glob("*.toml")):
        if not rooms or table.stem in rooms:
            for entry in tomllib.loads(table.read_text(encoding="utf-8"))["mutant"]:
                yield Mutant(table.stem, **{**entry, "tests": tuple(entry["tests"])})


def start(mutant: Mutant | None, tests: Sequence[str], folder: Path) -> int:
    """Process that runs the tests with a copy of the package in ``folder`` that holds the mutant (None: no change)."""
    copy = folder / "src" / "radcal"
    shutil.rmtree(copy, ignore_errors=True)
    # machine code of numba is left out: its cache is named after all compiled sources, so that a changed one is
    # compiled again, and others are compiled once for each folder
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("radcal-*"))
    for name in WORKFLOW:  # the copy is as complete as a clone
        if not (folder / name).is_symlink():
            (folder / name).symlink_to(CHECKOUT / name)
    if mutant is not None:
        (copy / mutant.room / mutant.file).write_text(mutant.source, encoding="utf-8")
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = 3
        try:
            os.setsid()
            with (folder / "log.txt").open("w") as log:
                os.dup2(log.fileno(), 1)
                os.dup2(log.fileno(), 2)
            if mutant is not None:  # CPU time does not depend on how busy the machine is
                resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
            _numba.CACHE_DIR = str(folder / "numba")
            os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(folder / "hypothesis")
            os.environ["PYTHONPATH"] = str(folder / "src")  # for programs that tests start
            os.environ["NUMBA_CACHE_DIR"] = str(folder / "numba")
            sys.path.insert(0, str(folder / "src"))
            os.chdir(CHECKOUT)
            code = int(pytest.main([*PYTEST, *(str(TESTS / name) for name in tests)]))
            sys.stdout.flush()
        finally:
            os._exit(code)
    return child


def ended(processes: Mapping[int, float]) -> tuple[int, int]:
    """Number and exit code of the next of some processes to end; the values are the times at which they are killed."""
    while True:
        for child, deadline in processes.items():
            found, status = os.waitpid(child, os.WNOHANG)
            if found:
                with contextlib.suppress(ProcessLookupError):  # programs that its tests have left
                    os.killpg(child, signal.SIGKILL)
                return child, os.waitstatus_to_exitcode(status)
            if time.monotonic() > deadline:
                os.killpg(child, signal.SIGKILL)
        time.sleep(0.05)


def check_tests(tests: Sequence[str], base: Path) -> None:
    """End with a sentence if the tests fail without any mutant."""
    code = ended({start(None, tests, base): np.inf})[1]
    if code:
        log = (base / "log.txt").read_text(encoding="utf-8", errors="replace")
        sys.exit(f"the tests fail without any mutant: mend them first.\n{log[-2000:]}")


def outcomes(chosen: Sequence[Mutant], jobs: int) -> dict[Mutant, bool]:
    """Whether each mutant survives; those that were run before are taken from the file of outcomes."""
    known: dict[str, bool] = json.loads(OUTCOMES.read_text(encoding="utf-8")) if OUTCOMES.exists() else {}
    keys = {mutant: mutant.key for mutant in chosen}
    left = [mutant for mutant in chosen if keys[mutant] not in known]
    total = len(left)
    with tempfile.TemporaryDirectory(prefix="radcal-mutants-") as name:
        free = [Path(name) / str(k) for k in range(jobs)]
        if left:
            check_tests(sorted({test for mutant in left for test in mutant.tests}), free[0])
        running: dict[int, tuple[Mutant, Path, float]] = {}
        while left or running:
            while left and free:
                mutant, folder = left.pop(0), free.pop()
                running[start(mutant, mutant.tests, folder)] = mutant, folder, time.monotonic() + TIMEOUT_S
            child, code = ended({number: deadline for number, (_, _, deadline) in running.items()})
            mutant, folder, _ = running.pop(child)
            if code in (3, 4, 5):  # an error of pytest itself, and no tests
                sys.exit(f"{mutant}: pytest ended with {code}: {(folder / 'log.txt').read_text()[-1000:]}")
            free.append(folder)
            known[keys[mutant]] = code == 0
            OUTCOMES.parent.mkdir(exist_ok=True)
            partial = OUTCOMES.with_suffix(".partial")
            partial.write_text(json.dumps(known, indent=1), encoding="utf-8")
            partial.replace(OUTCOMES)
            said = "SURVIVED" if code == 0 else "caught  " if code > 0 else "killed  "
            print(f"[{total - len(left) - len(running)}/{total}] {said} {mutant}", flush=True)
    return {mutant: known[key] for mutant, key in keys.items()}


def report(chosen: Sequence[Mutant], survived: dict[Mutant, bool]) -> bool:
    """Print the table by room and the survivors; whether every survivor has a reason."""
    rooms: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in chosen:
        rooms[mutant.room].append(mutant)
    print("\n| room | mutants | caught | survived | caught [%] |\n|---|---|---|---|---|")
    for room, members in [*rooms.items(), ("all", list(chosen))]:
        lived = sum(survived[mutant] for mutant in members)
        share = 100.0 * (1.0 - lived / len(members))
        print(f"| {room} | {len(members)} | {len(members) - lived} | {lived} | {share:.1f} |")
    left = [mutant for mutant in chosen if survived[mutant]]
    for mutant in left:
        print(f"survived: {mutant} ({mutant.reason or 'no test catches it'})")
    return all(mutant.reason for mutant in left)


def main() -> int:
    """Status 0 if every mutant was caught or has a reason to survive, else 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", help="rooms whose mutants are run (default: all)")
    parser.add_argument("--sample", type=int, help="number of mutants, drawn from those whose tests take seconds")
    parser.add_argument("--seed", type=int, default=0, help="seed of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="mutants that are run at the same time")
    options = parser.parse_args()
    chosen = list(mutants(options.rooms))
    for mutant in chosen:  # also those that a sample leaves out: the table fits the package
        _ = mutant.key
    if options.sample is not None:
        quick = [mutant for mutant in chosen if not mutant.slow]
        chosen = random.Random(options.seed).sample(quick, min(options.sample, len(quick)))
    return 0 if report(chosen, outcomes(chosen, options.jobs)) else 1


if __name__ == "__main__":
    sys.exit(main())

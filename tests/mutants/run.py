"""Mutation run: small bugs put into copies of the package one at a time, each with the tests that should catch it.

``python tests/mutants/run.py`` runs all mutants of the tables beside this file (one table for each room of the
package), ``python tests/mutants/run.py radar scene`` those of two rooms, and ``--sample 6`` six that take seconds. A
mutant is caught if one of its tests fails. Outcomes are kept in ``.mutants/outcomes.json``, so that the same command
continues an interrupted run; a mutant is run again once its tests or the file that it changes are others.

Fields of a mutant: ``file`` (below the room), ``before`` (text that occurs once in the file), ``after`` (text in its
place), ``tests`` (files below ``tests/``), ``reason`` (why no test can or should catch the mutant), ``slow`` (true
where the tests take more than a few seconds, so that samples leave the mutant out).
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

TABLES = Path(__file__).resolve().parent
TESTS = TABLES.parent
CHECKOUT = TESTS.parent
PACKAGE = CHECKOUT / "src" / "radcal"
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
        Files below ``tests/`` that should catch the mutant.
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
        parts = [self.source, *((TESTS / name).read_text(encoding="utf-8") for name in self.tests)]
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


def _limit_cpu() -> None:
    """End of the process after so much CPU time, which does not depend on how busy the machine is."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))


def survives(mutant: Mutant | None, tests: Sequence[str], folder: Path) -> bool:
    """Whether all tests pass with a copy of the package in ``folder`` that holds the mutant (None for no change)."""
    copy = folder / "src" / "radcal"
    shutil.rmtree(copy, ignore_errors=True)
    # machine code of numba is left out: its cache is named after all compiled sources, so that a changed one is
    # compiled again, and others are compiled once for each folder
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("radcal-*"))
    if mutant is not None:
        (copy / mutant.room / mutant.file).write_text(mutant.source, encoding="utf-8")
    environment = os.environ | {
        "PYTHONPATH": str(folder / "src"),
        "NUMBA_CACHE_DIR": str(folder / "numba"),
        "HYPOTHESIS_STORAGE_DIRECTORY": str(folder / "hypothesis"),
    }
    command = [sys.executable, "-m", "pytest", *PYTEST, *(str(TESTS / name) for name in tests)]
    try:
        ended = subprocess.run(
            command,
            cwd=CHECKOUT,
            env=environment,
            timeout=TIMEOUT_S if mutant is not None else None,
            preexec_fn=_limit_cpu if mutant is not None else None,
            capture_output=True,
            text=True,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False
    if ended.returncode in (3, 4, 5):  # an error of pytest itself, and no tests
        sys.exit(f"{mutant}: pytest ended with {ended.returncode}: {ended.stdout[-500:]}{ended.stderr[-500:]}")
    return ended.returncode == 0


def outcomes(chosen: Sequence[Mutant], jobs: int) -> dict[Mutant, bool]:
    """Whether each mutant survives; those that were run before are taken from the file of outcomes."""
    known: dict[str, bool] = json.loads(OUTCOMES.read_text(encoding="utf-8")) if OUTCOMES.exists() else {}
    keys = {mutant: mutant.key for mutant in chosen}
    left = [mutant for mutant in chosen if keys[mutant] not in known]
    with tempfile.TemporaryDirectory(prefix="radcal-mutants-") as base, ThreadPoolExecutor(jobs) as pool:
        folders: SimpleQueue[Path] = SimpleQueue()
        for k in range(jobs):
            folders.put(Path(base) / str(k))

        def run(mutant: Mutant | None, tests: Sequence[str]) -> bool:
            folder = folders.get()
            try:
                return survives(mutant, tests, folder)
            finally:
                folders.put(folder)

        if left and not run(None, sorted({name for mutant in left for name in mutant.tests})):
            sys.exit("the tests fail without any mutant: mend them first.")
        futures = {pool.submit(run, mutant, mutant.tests): mutant for mutant in left}
        for number, future in enumerate(as_completed(futures), start=1):
            mutant, survived = futures[future], future.result()
            known[keys[mutant]] = survived
            OUTCOMES.parent.mkdir(exist_ok=True)
            partial = OUTCOMES.with_suffix(".partial")
            partial.write_text(json.dumps(known, indent=1), encoding="utf-8")
            partial.replace(OUTCOMES)
            print(f"[{number}/{len(left)}] {'SURVIVED' if survived else 'caught  '} {mutant}", flush=True)
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

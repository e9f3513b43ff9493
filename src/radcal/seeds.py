"""Seeds and random generators for named uses, derived from the seed of the case."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from radcal.config.part import Part
    from radcal.sections.simulator import SimulatorConfig


def derived_seed(seed: int, *names: str | int, bits: int = 63) -> int:
    """Seed for a named use; seeds of different names are statistically independent.

    Parameters
    ----------
    seed : int
        Seed of the case.
    *names : str or int
        Name of the use, in one or several parts.
    bits : int
        Number of bits of the seed, 1 to 63: the seed is below ``2**bits``.

    Returns
    -------
    int
        Leading bits of a 64-bit hash of case seed and name. The value 0 is replaced by 1, because many programs take a
        seed from the clock when they receive 0.
    """
    text = "/".join([str(seed), *map(str, names)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> (64 - bits) or 1


def noise_seed(case: Part, fresh: bool = False) -> int:
    """Seed of speckle and thermal noise in all runs of a case, or, if ``fresh`` is true, in the final check run."""
    return derived_seed(case.seed, "runs", "fresh" if fresh else "common", bits=case.simulator.seed_bits)


def draw_seeds(case: Part) -> list[int]:
    """Seeds of all speckle draws of a run: first the common seed of all runs, then the seeds of the further draws.

    They differ from each other, and from the seed of the final check run, also if seeds have few bits.
    """
    found, fresh, k = [noise_seed(case)], noise_seed(case, fresh=True), 2
    while len(found) < case.simulator.draws:
        seed = derived_seed(case.seed, "runs", "draw", k, bits=case.simulator.seed_bits)
        if seed not in (*found, fresh):
            found.append(seed)
        k += 1
    return found


def measurement_seed(simulator: SimulatorConfig, seed: int) -> int:
    """Seed of speckle and thermal noise in a synthetic measurement."""
    return derived_seed(seed, "measurement", "noise", bits=simulator.seed_bits)


def derived_rng(seed: int, *names: str | int) -> np.random.Generator:
    """Random generator for a named use; generators of different names are statistically independent."""
    return np.random.default_rng(derived_seed(seed, *names))

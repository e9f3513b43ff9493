"""Random streams that derive from the case's one seed, by name."""

from __future__ import annotations

import hashlib

import numpy as np

__all__ = ["derived_rng", "derived_seed"]


def derived_seed(seed: int, *names: str | int) -> int:
    """A 63-bit seed for the named use, independent of all other names."""
    text = "/".join([str(seed), *map(str, names)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> 1


def derived_rng(seed: int, *names: str | int) -> np.random.Generator:
    """A generator for the named use, independent of all other names."""
    return np.random.default_rng(derived_seed(seed, *names))

"""Changes of sealed files on purpose, and damage to any file."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from radcal.storage.sealing import BLOCK, header


@contextmanager
def changed(path: str | Path) -> Iterator[h5py.File]:
    """Open a file of a results folder to change it; its checksum is written anew."""
    with h5py.File(path, "r+") as file:
        yield file
    seal(Path(path))


def seal(path: Path) -> None:
    """Write the checksum of an HDF5 file anew into its first bytes."""
    content = path.read_bytes()
    path.write_bytes(header(hashlib.sha256(content[BLOCK:]).hexdigest(), len(content)) + content[BLOCK:])


def flip(path: Path, random: np.random.Generator) -> None:
    """Turn one bit over."""
    content = bytearray(path.read_bytes())
    content[random.integers(len(content))] ^= 1 << random.integers(8)
    path.write_bytes(content)


def cut(path: Path, random: np.random.Generator) -> None:
    """Keep a random part of the beginning."""
    path.write_bytes(path.read_bytes()[: random.integers(path.stat().st_size)])


def scramble(path: Path, random: np.random.Generator) -> None:
    """Put noise over a random range of up to 4 KiB."""
    content = bytearray(path.read_bytes())
    start = random.integers(len(content))
    size = min(random.integers(1, 4097), len(content) - start)
    noise = random.bytes(size)
    content[start : start + size] = noise if noise != bytes(content[start : start + size]) else bytes(size)
    path.write_bytes(content)


DAMAGES = (flip, cut, scramble)

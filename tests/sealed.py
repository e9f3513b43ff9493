"""Changes of sealed files on purpose, and damage to any file."""

import hashlib
from contextlib import contextmanager
from pathlib import Path

import h5py

from radcal.storage.records import BLOCK, header


@contextmanager
def changed(path):
    """Open a file of a results folder to change it; its checksum is written anew."""
    with h5py.File(path, "r+") as file:
        yield file
    seal(Path(path))


def seal(path):
    """Write the checksum of an HDF5 file anew into its first bytes."""
    content = path.read_bytes()
    path.write_bytes(header(hashlib.sha256(content[BLOCK:]).hexdigest(), len(content)) + content[BLOCK:])


def flip(path, random):
    """Turn one bit over."""
    content = bytearray(path.read_bytes())
    content[random.integers(len(content))] ^= 1 << random.integers(8)
    path.write_bytes(content)


def cut(path, random):
    """Keep a random part of the beginning."""
    path.write_bytes(path.read_bytes()[: random.integers(path.stat().st_size)])


def scramble(path, random):
    """Put noise over a random range of up to 4 KiB."""
    content = bytearray(path.read_bytes())
    start = random.integers(len(content))
    size = min(random.integers(1, 4097), len(content) - start)
    noise = random.bytes(size)
    content[start : start + size] = noise if noise != bytes(content[start : start + size]) else bytes(size)
    path.write_bytes(content)


DAMAGES = (flip, cut, scramble)

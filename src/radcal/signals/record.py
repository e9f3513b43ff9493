"""Raw signal of a pass in blocks of pulses, which are kept as files until the product is finished."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.signals.history import BLOCK, raw_block
from radcal.signals.platform import Collection, collection
from radcal.signals.scatterers import Scatterers, scatterers
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic, digest

_VERSION = 1  # raised when the signal of the same settings changes


@dataclass(frozen=True)
class RawSignal:
    """Raw signal of a collection, of which a slice of pulses is simulated when it is asked for.

    Attributes
    ----------
    one : Collection
        Collection.
    found : Scatterers
        Scatterers.
    seed : int
        Noise seed.
    folder : path, optional
        Folder in which blocks of pulses are kept as files, so that none is simulated twice, also after a kill.
    """

    one: Collection
    found: Scatterers
    seed: int
    folder: Path | None = None

    def __len__(self) -> int:
        return len(self.one.track_m)

    def __getitem__(self, pulses: slice) -> NDArray[np.complex64]:
        first, last, _ = pulses.indices(len(self))
        blocks = [self._block(number) for number in range(first // BLOCK, -(-last // BLOCK))]
        start = first % BLOCK
        return np.concatenate(blocks)[start : start + last - first]

    def _block(self, number: int) -> NDArray[np.complex64]:
        def made() -> NDArray[np.complex64]:
            return raw_block(self.one, self.found, self.seed, number)

        return made() if self.folder is None else kept(self.folder / f"pulses-{number}.npy", made)


Signal = NDArray[np.complex64] | RawSignal
"""Raw signal, in memory or simulated when it is asked for."""


def kept(path: Path, make: Callable[[], NDArray[np.complex64]]) -> NDArray[np.complex64]:
    """Array of a file, which is made and written first if it is missing."""
    if path.exists():
        stored: NDArray[np.complex64] = np.load(path, allow_pickle=False)
        return stored
    made = make()
    with atomic(path) as partial, partial.open("wb") as file:
        np.save(file, made)
    return made


@contextlib.contextmanager
def signal_of(stem: Path, made: Forward) -> Iterator[RawSignal]:
    """Raw signal of a pass, whose files lie beside a product until the product is finished.

    Parameters
    ----------
    stem : path
        Path of the product's files without suffix.
    made : Forward
        Forward run of the pass, whose laws and seed are used.

    Yields
    ------
    RawSignal
        Signal, whose folder is named after all that the signal depends on: a later command with the same settings
        continues a killed one, and a command with others removes its files.
    """
    one, start = collection(made.case, made.scene), f".{stem.name}-"
    described = [_VERSION, made.key, made.seed, made.case.seed, made.case.signals.model_dump(mode="json")]
    folder = stem.parent / f"{start}{digest(described)}"
    for former in stem.parent.glob(f"{start}*"):
        if former != folder:
            shutil.rmtree(former, ignore_errors=True)
    yield RawSignal(one, scatterers(made.case, made.scene, made.seed, one.facet_m), made.seed, folder)
    shutil.rmtree(folder, ignore_errors=True)

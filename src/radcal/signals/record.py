"""Raw signal of a pass in blocks of pulses, which are kept as files until the product is finished."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from radcal.errors import DamagedError
from radcal.signals.history import BLOCK, echoes, receiver_noise
from radcal.signals.platform import Collection, collection
from radcal.signals.scatterers import Scatterers, scatterers
from radcal.simulators.forward import Forward
from radcal.storage.files import digest
from radcal.storage.records import read_hdf5, write_hdf5


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
        blocks = [self._kept(number) for number in range(first // BLOCK, -(-last // BLOCK))]
        start = first % BLOCK
        return np.concatenate(blocks)[start : start + last - first]

    def block(self, number: int) -> NDArray[np.complex64]:
        """Pulses of one block, with noise, before the converter; the bits do not depend on the number of threads."""
        first, last = number * BLOCK, min((number + 1) * BLOCK, len(self))
        pulses = echoes(self.one, self.found, first, last)
        if self.one.noise_m2 > 0.0:
            pulses += receiver_noise(self.one, self.seed, first, last)
        return pulses

    def _kept(self, number: int) -> NDArray[np.complex64]:
        if self.folder is None:
            return self.block(number)
        return kept(self.folder / f"pulses-{number}.h5", lambda: self.block(number))


class Pulses(Protocol):
    """Raw signal, in memory or made when a slice of pulses is asked for."""

    def __getitem__(self, pulses: slice, /) -> NDArray[np.complex64]: ...


def kept(path: Path, make: Callable[[], NDArray[np.complex64]]) -> NDArray[np.complex64]:
    """Array of a file, which is made and written first if it is missing or damaged."""
    if path.exists():
        with contextlib.suppress(DamagedError), read_hdf5(path, "signal_part") as file:
            return np.asarray(file["values"][()])
    made = make()
    with write_hdf5(path, "signal_part") as file:
        file["values"] = made
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
    described = [made.key, made.seed, made.case.seed, made.case.signals.model_dump(mode="json")]
    folder = stem.parent / f"{start}{digest(described)}"
    for former in stem.parent.glob(f"{start}*"):
        if former != folder:
            shutil.rmtree(former, ignore_errors=True)
    yield RawSignal(one, scatterers(made.case, made.scene, made.seed, one.facet_m), made.seed, folder)
    shutil.rmtree(folder, ignore_errors=True)

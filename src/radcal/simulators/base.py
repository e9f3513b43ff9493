"""Interfaces of simulators, as Python protocols: an intensity image, which all give, and complex looks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from radcal.sections.base import Section

if TYPE_CHECKING:
    from radcal.config.part import Part
    from radcal.radar.geometry import Geometry


class Simulator(Protocol):
    """Simulator of a pass: it has an identity and turns one parameter vector per material into an image."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """Plain data that identify the simulator; they differ between simulators that may give different images."""

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass.

        Parameters
        ----------
        parameters : mapping
            Law parameters X of every material of the scene, by name of the material.
        noise_seed : int
            Seed of speckle and thermal noise; runs with equal seeds use equal random numbers.

        Returns
        -------
        ndarray of float32, shape (slant range, azimuth)
            Multilooked intensity in the configured radiometry [dB].

        Raises
        ------
        SimulatorError
            The simulation failed.
        """


class SimulatorKind(Simulator, Protocol):
    """Kind of simulator, which ``simulator.kind`` names.

    Attributes
    ----------
    section : type of PythonSimulation
        Model of section ``simulator`` of a kind of another distribution, with the kind as the only value of ``kind``.
    """

    section: type[Section]

    @classmethod
    def of(cls, case: Part, geometry: Geometry, geometry_path: str | Path) -> Simulator:
        """Simulator of a pass, from the sections ``simulator``, ``materials`` and ``radar``.

        Parameters
        ----------
        case : Part
            Configuration of the pass; ``case.laws`` are the laws of its materials.
        geometry : Geometry
            Geometry of the pass.
        geometry_path : path
            Path of the geometry file.
        """


@runtime_checkable
class Looks(Protocol):
    """Simulator that also gives the product ``complex``: the complex looks of the intensity of a run."""

    def looks(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> Iterator[NDArray[np.complex64]]:
        """Complex looks of a pass, one after the other; the mean of their power is the intensity of :meth:`run`.

        Parameters
        ----------
        parameters, noise_seed : mapping, int
            As for :meth:`Simulator.run`.

        Yields
        ------
        ndarray of complex64, shape (slant range, azimuth)
            Amplitude, whose squared magnitude is linear power in the configured radiometry.
        """

"""Laws, reader, source of scenes, method of registration and simulator that another distribution adds to radcal."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from radcal.findings import Finding
from radcal.image.base import Facts, Grid, Reader, ReadImage
from radcal.laws import Law
from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.model import Scene
from radcal.sections.scene import SceneSection
from radcal.sections.simulator import PythonSimulation
from radcal.storage.files import digest


def line(phi: Any, parameters: Any) -> Any:
    """Level at 0 and slope [dB, dB/rad]."""
    return parameters[0] + parameters[1] * np.asarray(phi)


LINE = Law(line, ("A", "B"), ("dB", "dB/rad"), ((-30.0, 0.0), (-20.0, 0.0)))


def damp(phi: Any, parameters: Any, *, permittivity: float) -> Any:
    """Level plus the permittivity, as a law with a condition."""
    return parameters[0] + permittivity + 0.0 * phi


DAMP = Law(damp, ("level",), ("dB",), needs=("permittivity",))


class TextReader(Reader):
    """Reader of tables of power whose names end with .sar."""

    called = "a table of power"
    gives_radiometry = True

    @classmethod
    def matches(cls, path: Path) -> bool:
        """Whether the ending is .sar."""
        return path.suffix == ".sar"

    def facts(self, scene: Scene | None = None) -> Facts:
        """First line: polarisation and radiometry."""
        polarisation, radiometry = self.path.read_text().splitlines()[0].split()
        return Facts(polarisation=polarisation, radiometry=radiometry)

    def read(self, grid: Grid) -> ReadImage:
        """Numbers below the first line."""
        read = self.in_db(np.loadtxt(self.path, skiprows=1), "power", grid.shape)
        return ReadImage(*read, (Finding("foreign", "note", self.name, {"text": "levels of a table"}),))


class Ramp(SceneSection):
    """Ground that rises to the east, with a dyke in the south and grass in the north."""

    source: Literal["elsewhere_ramp"] = "elsewhere_ramp"
    side: int = Field(ge=20)
    slope: float = 0.1


class RampSource(SceneSource):
    """Source of ramps."""

    section = Ramp

    @staticmethod
    def size(config: Ramp) -> SceneSize:
        """Square of cells of 5 m."""
        return SceneSize(config.side**2, 5.0, config.side**2)

    @staticmethod
    def make(config: Ramp, heading_deg: float) -> Scene:
        """Scene without a place on the map."""
        height = np.tile(5.0 * config.slope * np.arange(config.side), (config.side, 1))
        material = np.ones(height.shape, np.uint8)
        material[config.side // 2 :] = 2
        return Scene(digest({"ramp": config.slope}), ("dyke", "grass"), material, height, 5.0)


def half_px(fixed: Any, moving: Any, start: Any, gefolki_px: Any) -> Any:
    """Half of the displacement that GeFolki finds."""
    return 0.5 * gefolki_px


class LevelSimulation(PythonSimulation):
    """Section of the simulator, with a key of its own."""

    kind: Literal["elsewhere_level"] = "elsewhere_level"
    gain_db: float = 0.0


class LevelSimulator:
    """Image of each material's sigma0 at its mean incidence, without speckle."""

    section = LevelSimulation

    def __init__(self, case: Any, geometry: Any) -> None:
        self.laws, self.geometry, self.gain_db = case.laws, geometry, case.simulator.gain_db

    @classmethod
    def of(cls, case: Any, geometry: Any, geometry_path: Any) -> LevelSimulator:
        """Simulator of a pass."""
        return cls(case, geometry)

    @property
    def identity(self) -> dict[str, Any]:
        """What else decides its numbers."""
        return {"kind": "elsewhere_level", "gain_db": self.gain_db}

    def run(self, parameters: Any, noise_seed: int) -> Any:
        """Image [dB]."""
        image = np.full(self.geometry.shape, -99.0, dtype=np.float32)
        for name in self.geometry.names:
            pixels = self.geometry.pixels(name)
            phi = np.radians(self.geometry.incidence_deg.ravel()[pixels]).mean()
            image.ravel()[pixels] = float(self.laws[name](phi, parameters[name])) + self.gain_db
        return image

"""Section ``scene``: source of elevation, materials and objects."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field, SerializeAsAny, model_validator

from radcal.plugins import HasSection, Plugins, with_foreign
from radcal.reading.cdb import BASE_MATERIALS, cdb_files, imagery_files
from radcal.reading.vectors import ENDINGS
from radcal.sections.base import Section, VrtFolders, with_tag
from radcal.sections.errors import Wrong
from radcal.sections.limits import Coordinate, Decibels, Integer, Length, Real, Seed
from radcal.tables.landcover import LandCover

Longitude = Annotated[Real, Field(ge=-180, le=180)]
Latitude = Annotated[Real, Field(ge=-90, le=90)]
_SOURCE = "source of the scene: builtin, slant_range, raster, vectors or cdb; each source has its own keys"
DBSM_LIMITS = (-100.0, 70.0)  # 70 dBsm (10 km2) is more than any object has; larger numbers must be square metres
WALL_DB_LIMITS = (-60.0, 30.0)  # sigma0 of walls [dB]
_CROSS_SECTIONS = "table of cross-sections over aspect and elevation angle: .csv or .h5"


def _ordered(bounds: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    west, south, east, north = bounds
    if not (west < east and south < north):
        raise ValueError(f"are [{west:g}, {south:g}, {east:g}, {north:g}], expected west < east and south < north")
    return bounds


class Permittivity(Section):
    """Relative permittivities (real part) that reduce the double bounce between walls and ground."""

    wall: Annotated[Real, Field(gt=1, le=100)] = Field(description="relative permittivity of the walls")
    ground: Annotated[Real, Field(gt=1, le=100)] = Field(
        description="relative permittivity of the ground in front of the walls"
    )

    @property
    def pair(self) -> tuple[float, float]:
        """Permittivities of walls and ground."""
        return self.wall, self.ground


class GeneratedObjects(Section):
    """Numbers of the objects that radcal generates at random positions, uniformly distributed over the scene."""

    trees: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of trees")
    cars: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of cars")
    buildings: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of buildings")
    seed: Seed = Field(1, description="seed of the positions and sizes of the objects")

    @model_validator(mode="after")
    def _some(self) -> Self:
        if self.trees + self.cars + self.buildings == 0:
            raise ValueError("has no object, expected a number of trees, cars or buildings")
        return self


class SceneObjects(Section):
    """Objects in the scene, either listed in a table or generated."""

    path: str | None = Field(None, description="table of objects: .csv, .gpkg, .shp, .geojson or .h5")
    layer: str | None = Field(None, description="layer of the file; required if the file has several layers")
    aspect: dict[str, list[tuple[Annotated[Real, Field(ge=-180, le=360)], Decibels]]] = Field(
        default_factory=dict,
        description="curves by name, as pairs of aspect [deg] and cross-section [dBsm]; column aspect of the table "
        "names them",
    )
    cross_sections: str | None = Field(
        None, description=f"{_CROSS_SECTIONS}; the objects' column aspect names its classes"
    )
    permittivity: Permittivity | None = Field(
        None, description="permittivities for the double bounce; without them walls reflect all power"
    )
    generate: GeneratedObjects | None = Field(
        None, description="numbers of trees, cars and buildings to generate, instead of path"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.path is None) == (self.generate is None):
            raise ValueError(
                f"has {'neither' if self.path is None else 'both'} path and generate, expected one of them"
            )
        for name in ("layer", "aspect", "cross_sections", "permittivity"):
            if self.path is None and getattr(self, name):
                raise ValueError(f"{name} is for a table, expected path beside it")
        for name, points in self.aspect.items():
            if (wrong := check_curve(points)) is not None:
                raise ValueError(f"aspect.{name} {wrong}")
        return self


Objects = Annotated[
    SceneObjects | None, Field(description="objects on the ground, such as buildings and trees (docs/objects.md)")
]


class SceneSection(Section):
    """Section ``scene`` of one source; the model of a source adds its keys.

    Attributes
    ----------
    source : str
        Name of the source.
    files : mapping
        Keys that name files, each with its kind: ``raster``, ``file`` or ``database`` (a folder).
    on_map : bool
        Whether the grid of the scene has a place on the map, so that it can be turned to the track.
    has_heights : bool
        Whether the scene has an elevation.
    """

    files: ClassVar[Mapping[str, str]] = {}
    on_map: ClassVar[bool] = False
    has_heights: ClassVar[bool] = True
    source: str

    @property
    def on_ground(self) -> SceneObjects | None:
        """Section ``objects``; None for a scene without objects, or of a source without this key."""
        found: SceneObjects | None = getattr(self, "objects", None)
        return found

    def files_in(self, folder: Path) -> list[Path]:
        """Files of the scene in the folder of a database."""
        return [folder]


class BuiltinScene(SceneSection):
    """Four square kilometres of SRTM terrain with seven materials, among them a dyke."""

    source: Literal["builtin"] = Field("builtin", description=_SOURCE)
    seed: Seed = Field(1, description="seed of the shapes of fields and of the fine relief")
    landscape: Literal["enclosed", "open"] = Field(
        "enclosed",
        description="enclosed: ridged fields between hedges, tall forest, a dyke of varying slope; open: level fields "
        "and a dyke of one slope",
    )
    objects: Objects = None


class SlantRangeScene(SceneSection):
    """Raster of material ids over flat ground: rows are slant range, columns azimuth."""

    files: ClassVar[Mapping[str, str]] = {"labels": "raster", "names": "file"}
    has_heights = False
    source: Literal["slant_range"] = Field("slant_range", description=_SOURCE)
    labels: str = Field(description="GeoTIFF of material ids; 0 means no material")
    names: str = Field(description="JSON file of material names by id")
    near_incidence_deg: Annotated[Real, Field(gt=0, lt=90)] = Field(
        description="local incidence angle at the first row [deg]"
    )
    far_incidence_deg: Annotated[Real, Field(gt=0, lt=90)] = Field(
        description="local incidence angle at the last row [deg]"
    )

    vrt_folders: VrtFolders = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.near_incidence_deg >= self.far_incidence_deg:
            raise Wrong(
                "near_incidence_deg",
                f" ({self.near_incidence_deg:g}) must be below far_incidence_deg ({self.far_incidence_deg:g})",
            )
        return self


class GridScene(SceneSection):
    """Georeferenced raster of elevation, and a file of materials, on one grid."""

    on_map = True
    elevation: str = Field(description="GeoTIFF or other raster of heights [m]")
    crs: str | None = Field(
        None,
        description="projected CRS of the scene, such as EPSG:32631; by default that of the elevation if it is in "
        "metres, else UTM",
    )
    cell_m: Length | None = Field(None, description="cell size of the scene [m]; by default that of the elevation")
    bounds: Annotated[tuple[Coordinate, Coordinate, Coordinate, Coordinate], AfterValidator(_ordered)] | None = Field(
        None,
        description="[west, south, east, north] in the CRS of the scene [m]; by default the overlap of the rasters",
    )
    vertical_datum: str | None = Field(
        None, description="vertical datum of the heights, such as EGM96; required if their CRS names none"
    )
    elevation_error_m: Annotated[Real, Field(ge=0, le=100)] = Field(
        0.0,
        description="standard error of a height relative to its neighbours [m]; the error of rounded heights is added",
    )
    vrt_folders: VrtFolders = None
    objects: Objects = None


class RasterScene(GridScene):
    """Georeferenced rasters of elevation and materials."""

    files: ClassVar[Mapping[str, str]] = {"elevation": "raster", "materials": "raster", "names": "file"}
    source: Literal["raster"] = Field("raster", description=_SOURCE)
    materials: str = Field(description="raster of material ids in any CRS; 0 means no material")
    names: str | None = Field(
        None,
        description="JSON file of material names by id; overrides the names of landcover; required without landcover",
    )
    landcover: LandCover | None = Field(
        None,
        description="land-cover map whose codes the raster of materials contains; gives materials names and starting "
        "laws (docs/landcover.md)",
    )

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.elevation == self.materials:
            raise Wrong(
                "elevation", f" and materials are the same file {self.elevation}, expected heights and material ids"
            )
        if Path(self.materials).suffix.lower() in ENDINGS:
            raise Wrong("materials", f" is {self.materials}, a vector file, which needs scene.source: vectors")
        if self.names is None and self.landcover is None:
            raise Wrong("names", " is missing, expected a file of names, or landcover")
        return self


class VectorScene(GridScene):
    """Raster of elevation, and vector features that a mapping turns into materials and objects."""

    files: ClassVar[Mapping[str, str]] = {
        "elevation": "raster",
        "materials": "file",
        "names": "file",
        "cross_sections": "file",
    }
    source: Literal["vectors"] = Field("vectors", description=_SOURCE)
    materials: str = Field(description="GeoPackage, shapefile or GeoJSON in any CRS")
    names: str = Field(
        description="YAML file that maps attributes of features to materials and objects (docs/vectors.md)"
    )
    cross_sections: str | None = Field(None, description=f"{_CROSS_SECTIONS}; the mapping names its classes")

    @model_validator(mode="after")
    def _vectors(self) -> Self:
        if Path(self.materials).suffix.lower() not in ENDINGS:
            raise Wrong("materials", f" is {self.materials}, expected a file ending with {', '.join(ENDINGS)}")
        return self


class CdbScene(SceneSection):
    """OGC CDB 1.x database."""

    files: ClassVar[Mapping[str, str]] = {"materials": "file", "cross_sections": "file", "root": "database"}
    on_map = True
    source: Literal["cdb"] = Field("cdb", description=_SOURCE)
    root: str = Field(description="folder of the database, which contains the folder Tiles")
    bounds: Annotated[tuple[Longitude, Latitude, Longitude, Latitude], AfterValidator(_ordered)] = Field(
        description="[west, south, east, north] of the scene, on WGS 84 [deg]"
    )
    materials: str = Field(
        description="YAML file that maps composite materials to materials, and feature codes to objects (docs/cdb.md)"
    )
    cross_sections: str | None = Field(None, description=f"{_CROSS_SECTIONS}; the mapping names its classes")
    crs: str | None = Field(
        None, description="projected CRS of the scene, such as EPSG:32611; by default the UTM zone of its middle"
    )
    cell_m: Length | None = Field(
        None, description="cell size of the scene [m]; by default that of the finest raster of materials"
    )
    vertical_datum: str | None = Field(
        None, description="vertical datum of the heights; by default the WGS 84 ellipsoid, as the standard says"
    )

    def files_in(self, folder: Path) -> list[Path]:
        """Files of the tiles that overlap the bounds, and the list of base materials.

        Raises
        ------
        ValueError
            The folder has no such tile.
        """
        tiles, pictures = (
            [one.path for one in files(folder, self.bounds) if not one.fault] for files in (cdb_files, imagery_files)
        )
        if not tiles:
            raise ValueError(f"it has no tile within scene.bounds {list(self.bounds)}, expected Tiles/N32/W118/...")
        return [*tiles, *pictures, *(path for path in [folder / BASE_MATERIALS] if path.is_file())]


SCENES: Plugins[HasSection] = Plugins(
    "radcal.scenes",
    {
        "builtin": "radcal.scene.builtin:BuiltinSource",
        "slant_range": "radcal.scene.slant_range:SlantRangeSource",
        "raster": "radcal.scene.raster:RasterSource",
        "vectors": "radcal.vectors.features:VectorSource",
        "cdb": "radcal.cdb.source:CdbSource",
    },
)
"""Sources of scenes (:class:`radcal.scene.base.SceneSource`) by ``scene.source``."""

SceneConfig = Annotated[
    SerializeAsAny[BuiltinScene | SlantRangeScene | RasterScene | VectorScene | CdbScene],
    Field(discriminator="source"),
    with_foreign("source", SCENES, BuiltinScene, SlantRangeScene, RasterScene, VectorScene, CdbScene),
    with_tag("scene", "builtin"),
]


def check_curve(points: ArrayLike) -> str | None:
    """Description of the first error in a curve of cross-section by aspect; None if the curve is valid.

    Parameters
    ----------
    points : array_like, shape (k, 2)
        Aspect [deg] and cross-section [dBsm] of each point of the curve.
    """
    curve = np.asarray(points, dtype=np.float64)
    if curve.ndim != 2 or curve.shape[1] != 2 or len(curve) < 2:
        return f"has shape {list(curve.shape)}, expected at least two pairs of aspect [deg] and cross-section [dBsm]"
    if not np.isfinite(curve).all():
        return "holds a number that is not finite"
    if curve[:, 0].min() < -180.0 or curve[:, 0].max() > 360.0:
        wrong = curve[np.argmax(np.abs(curve[:, 0] - 90.0)), 0]
        return f"has an aspect of {wrong:g} degrees, expected -180 to 360"
    turned, first = np.unique(curve[:, 0] % 360.0, return_index=True)
    if len(turned) < len(curve):
        twice = np.setdiff1d(np.arange(len(curve)), first)[0]
        return f"gives the aspect {curve[twice, 0]:g} degrees twice (0 and 360 are one)"
    low, high = DBSM_LIMITS
    if curve[:, 1].min() < low or curve[:, 1].max() > high:
        wrong = curve[np.argmax(np.abs(curve[:, 1])), 1]
        return f"has a cross-section of {wrong:g}, expected {low:g} to {high:g} dBsm (10 log10 of square metres)"
    return None

"""Section ``scene``: source of elevation, materials and objects."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from radcal.config.limits import Coordinate, Decibels, Integer, Length, Real, Seed
from radcal.config.sections import Section
from radcal.scene.objects import check_curve

__all__ = ["BuiltinScene", "GeneratedObjects", "RasterScene", "SceneConfig", "SceneObjects", "SlantRangeScene"]
_SOURCE = "builtin, slant_range or raster; each has keys of its own"


class GeneratedObjects(Section):
    """Generated objects, scattered evenly over the ground."""

    trees: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of trees")
    cars: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of cars")
    buildings: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of buildings")
    seed: Seed = Field(1, description="seed of the objects' places and sizes")

    @model_validator(mode="after")
    def _some(self) -> Self:
        if self.trees + self.cars + self.buildings == 0:
            raise ValueError("has no object, expected a number of trees, cars or buildings")
        return self


class SceneObjects(Section):
    """Objects in the scene, from a table or generated."""

    path: str | None = Field(None, description="table of objects: .csv, .gpkg or .h5")
    layer: str | None = Field(None, description="layer of a GeoPackage; needed where it has several")
    aspect: dict[str, list[tuple[Annotated[Real, Field(ge=-180, le=360)], Decibels]]] = Field(
        default_factory=dict,
        description="name of a curve -> pairs of [aspect in degrees, cross-section in dBsm]; the table's column aspect "
        "names a curve",
    )
    generate: GeneratedObjects | None = Field(
        None, description="generated trees, cars and buildings in place of a table"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.path is None) == (self.generate is None):
            raise ValueError(
                f"has {'neither' if self.path is None else 'both'} path and generate, expected one of them"
            )
        if self.path is None and (self.layer is not None or self.aspect):
            raise ValueError(
                f"{'layer' if self.layer is not None else 'aspect'} is for a table, expected path beside it"
            )
        for name, points in self.aspect.items():
            if (wrong := check_curve(points)) is not None:
                raise ValueError(f"aspect.{name} {wrong}")
        return self


class BuiltinScene(Section):
    """Four square kilometres of real SRTM terrain with seven materials and a dyke."""

    source: Literal["builtin"] = Field("builtin", description=_SOURCE)
    seed: Seed = Field(1, description="seed of the layout of the agricultural fields and of the terrain's fine relief")
    objects: SceneObjects | None = Field(None, description="objects on the ground")


class SlantRangeScene(Section):
    """A label raster in slant range over flat ground: rows are range, columns are azimuth."""

    source: Literal["slant_range"] = Field("slant_range", description=_SOURCE)
    labels: str = Field(description="GeoTIFF of material ids, 0 = no material")
    names: str = Field(description="JSON file: material id -> name")
    near_incidence_deg: Annotated[Real, Field(gt=0, lt=90)] = Field(
        description="local incidence angle at the first row [deg]"
    )
    far_incidence_deg: Annotated[Real, Field(gt=0, lt=90)] = Field(
        description="local incidence angle at the last row [deg]"
    )

    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.near_incidence_deg >= self.far_incidence_deg:
            raise ValueError(
                f"near_incidence_deg ({self.near_incidence_deg:g}) must be below "
                f"far_incidence_deg ({self.far_incidence_deg:g})"
            )
        return self


class RasterScene(Section):
    """Elevation and materials from georeferenced rasters, resampled to one grid."""

    source: Literal["raster"] = Field("raster", description=_SOURCE)
    elevation: str = Field(description="GeoTIFF or other raster of heights [m]")
    materials: str = Field(description="raster of material ids in any CRS, 0 = no material")
    names: str = Field(description="JSON file: material id -> name")
    crs: str | None = Field(
        None,
        description="projected CRS of the scene, such as EPSG:32631; if missing, the elevation's where that is in "
        "metres, else UTM",
    )
    cell_m: Length | None = Field(None, description="cell size [m]; the elevation's own if missing")
    bounds: tuple[Coordinate, Coordinate, Coordinate, Coordinate] | None = Field(
        None,
        description="[west, south, east, north] in the scene's CRS [m]; the ground that both rasters cover if missing",
    )
    vertical_datum: str | None = Field(
        None,
        description="vertical datum of the heights, such as EGM96; needed where the elevation's CRS does not name it",
    )
    elevation_error_m: Annotated[Real, Field(ge=0, le=100)] = Field(
        0.0,
        description="standard error of a height against its neighbours [m], from which that of the incidence follows; "
        "the rounding error of heights in whole metres is added",
    )
    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )
    objects: SceneObjects | None = Field(None, description="objects on the ground")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.bounds is not None:
            west, south, east, north = self.bounds
            if not (west < east and south < north):
                raise ValueError(
                    f"bounds are [{west:g}, {south:g}, {east:g}, {north:g}], expected west < east and south < north"
                )
        return self


SceneConfig = Annotated[BuiltinScene | SlantRangeScene | RasterScene, Field(discriminator="source")]

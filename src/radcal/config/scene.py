"""Section ``scene``: where elevation, materials and objects come from."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from radcal.config.limits import Coordinate, Decibels, Integer, Length, Real, Seed
from radcal.config.sections import Section
from radcal.scene.objects import check_curve

__all__ = ["BuiltinScene", "GeneratedObjects", "RasterScene", "SceneConfig", "SceneObjects", "SlantRangeScene"]
_SOURCE = "builtin, slant_range or raster: each with keys of its own"


class GeneratedObjects(Section):
    """Made-up objects, scattered evenly."""

    trees: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of trees")
    cars: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of cars")
    buildings: Annotated[Integer, Field(ge=0, le=10_000_000)] = Field(0, description="number of buildings")
    seed: Seed = Field(1, description="seed of their places and sizes")

    @model_validator(mode="after")
    def _some(self) -> Self:
        if self.trees + self.cars + self.buildings == 0:
            raise ValueError("has no object, expected a number of trees, cars or buildings")
        return self


class SceneObjects(Section):
    """Objects that stand in the scene: a table, or made up."""

    path: str | None = Field(None, description="table of objects: .csv, .gpkg or .h5")
    layer: str | None = Field(None, description="layer of a GeoPackage; needed where it has several")
    aspect: dict[str, list[tuple[Annotated[Real, Field(ge=-180, le=360)], Decibels]]] = Field(
        default_factory=dict, description="aspect class -> [aspect in degrees, cross-section in dBsm] pairs"
    )
    generate: GeneratedObjects | None = Field(None, description="made-up trees, cars and buildings in place of a table")

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
    seed: Seed = Field(1, description="seed of the fields' layout and of the fine roughness")
    objects: SceneObjects | None = Field(None, description="what stands on the ground")


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
        description="projected CRS of the scene, such as EPSG:32631; the elevation's if that is in metres, else UTM",
    )
    cell_m: Length | None = Field(None, description="cell size [m]; the elevation's own if missing")
    bounds: tuple[Coordinate, Coordinate, Coordinate, Coordinate] | None = Field(
        None, description="[west, south, east, north] in the scene's CRS [m]; where both rasters are if missing"
    )
    vertical_datum: str | None = Field(
        None, description="what heights refer to, such as EGM96; needed where the elevation's CRS does not say"
    )
    elevation_error_m: Annotated[Real, Field(ge=0, le=100)] = Field(
        0.0, description="standard error of a height against its neighbours [m]: of the incidence a law is found at"
    )
    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )
    objects: SceneObjects | None = Field(None, description="what stands on the ground")

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

"""Coordinate reference systems of rasters: horizontal coordinates and vertical datum.

Coordinates are always in the order (east, north) or (longitude, latitude), as in rasters, even if the definition of the
CRS has another order of axes.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
import warnings
from typing import TYPE_CHECKING, Any

from radcal.errors import SceneError
from radcal.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pyproj import CRS, Transformer

    from radcal.scene.model import Scene

METRES = ("m", "metre", "metres", "meter", "meters")
# keys of a raster's metadata that hold the unit of its heights, letters alone: "Vertical Units", ELEVATION_UNITS (PCI)
_UNIT_KEYS = re.compile(r"(vertical|elevation|height|z)units?")
_OTHER_UNITS = re.compile(
    r"(us|international)? ?(survey)? ?(feet|foot|ft|yards?|fathoms?|(deci|centi|milli|kilo)met(er|re)s?|dm|cm|mm|km)"
)
_UNNAMED = ("unknown", "unnamed", "undefined", "")
_HALF_M = 1000.0  # half of the distance over which the scale of a grid is computed
# files of grids, which PROJ would read; @null stands for no file
_GRID_FILE = re.compile(r'(?:PARAMETERFILE\["[^"]*",\s*"|(?:grids|file|model)=)(?!@null["\s])([^"\s]*)', re.IGNORECASE)


def crs_of(raster: Any) -> CRS | None:
    """CRS of an open rasterio dataset, or None if the dataset has neither a geographic nor a projected CRS.

    Parameters
    ----------
    raster : rasterio.DatasetReader
        An open raster.

    Returns
    -------
    pyproj.CRS or None
        Geographic, projected or compound CRS.

    Raises
    ------
    pyproj.exceptions.CRSError
        The CRS is not known, or names a file of a grid.
    """
    import rasterio

    if not raster.crs:
        return None
    # WKT 1 has no three-dimensional CRS
    crs = crs_from(raster.crs.to_wkt(version=rasterio.enums.WktVersion.WKT2_2019))
    plane = horizontal(crs)
    return crs if plane.is_geographic or plane.is_projected else None


def crs_from(text: str) -> CRS:
    """CRS from a code, WKT or PROJ text of the user; a CRS that names a file of a grid raises CRSError, too."""
    import pyproj

    crs = pyproj.CRS.from_user_input(text)
    if found := _GRID_FILE.search(crs.to_wkt()):
        raise pyproj.exceptions.CRSError(
            f"its CRS {crs.name!r} names the grid {found[1]!r}, expected a CRS without files of grids"
        )
    return crs


def horizontal(crs: CRS) -> CRS:
    """Horizontal part of a CRS, without its vertical axis if it has one."""
    if crs.is_compound:
        return crs.sub_crs_list[0]
    return crs.to_2d() if len(crs.axis_info) == 3 else crs


def same_place(one: CRS, other: CRS) -> bool:
    """Whether two horizontal CRSs are equal apart from the order of their axes."""
    return one.equals(other, ignore_axis_order=True)


@functools.lru_cache(maxsize=64)
def transformer(source: CRS | str, target: CRS | str) -> Transformer:
    """Transformation of coordinates between two CRSs; the search of the EPSG database for one takes 10 to 100 ms.

    Raises
    ------
    SceneError
        There is no transformation between the two CRSs.
    """
    import pyproj

    try:
        return pyproj.Transformer.from_crs(source, target, always_xy=True)
    except pyproj.exceptions.ProjError:
        names = [pyproj.CRS.from_user_input(crs).name for crs in (source, target)]
        raise SceneError(
            f"scene: coordinates in {names[0]} cannot be converted to {names[1]}, expected CRSs of the earth."
        ) from None


def longitude_latitude(scene: Scene, x_m: Any, y_m: Any) -> tuple[Any, Any] | None:
    """Longitude and latitude of places to the east and to the north of the corner of a scene's grid [deg].

    Parameters
    ----------
    scene : Scene
        Scene.
    x_m, y_m : float or ndarray
        Places along axes 1 and 0 of the grid [m].

    Returns
    -------
    tuple of two float or ndarray, or None
        None for a scene without a place on the map.
    """
    if scene.crs is None or scene.transform is None:
        return None
    return coordinates(scene.crs, scene.transform, x_m / scene.cell_m, y_m / scene.cell_m, "EPSG:4326")


def coordinates(crs: str, transform: Sequence[float], column: Any, row: Any, other: CRS | str) -> tuple[Any, Any]:
    """Coordinates in another CRS of places in a scene's grid.

    Parameters
    ----------
    crs, transform : str, sequence of 6 float
        The scene's CRS, and coefficients a, b, c, d, e, f of its affine transform from (column, row) of cell corners.
    column, row : float or ndarray
        Places.
    other : pyproj.CRS or str
        CRS of the coordinates, which are infinite outside of its domain.
    """
    a, b, c, d, e, f = transform
    found: tuple[Any, Any] = transformer(crs, other).transform(a * column + b * row + c, d * column + e * row + f)
    return found


@functools.lru_cache(maxsize=64)
def label(crs: CRS) -> str:
    """Text from which :class:`pyproj.CRS` restores a CRS: its authority code, such as ``EPSG:32631``, else its WKT."""
    authority = crs.to_authority(min_confidence=100)
    return ":".join(authority) if authority else crs.to_wkt()


@functools.lru_cache(maxsize=64)
def utm(longitude_deg: float, latitude_deg: float) -> CRS | None:
    """CRS of the UTM zone (WGS 84) that contains a place; None near the poles, where there are no UTM zones.

    Parameters
    ----------
    longitude_deg, latitude_deg : float
        Longitude and latitude of the place [deg].
    """
    import pyproj

    place = pyproj.aoi.AreaOfInterest(longitude_deg, latitude_deg, longitude_deg, latitude_deg)
    found = pyproj.database.query_utm_crs_info("WGS 84", place)
    return pyproj.CRS.from_authority(found[0].auth_name, found[0].code) if found else None


def turned(crs: CRS, place: tuple[float, float], heading_deg: float) -> CRS:
    """CRS whose second axis points along a track, and whose first axis points to the right of the track.

    Parameters
    ----------
    crs : pyproj.CRS
        Projected CRS.
    place : (float, float)
        Coordinates in ``crs`` of the place that becomes the origin; the scale is 1 on the central line through this
        place.
    heading_deg : float
        Heading of the track at this place, clockwise from north [deg].

    Returns
    -------
    pyproj.CRS
        Hotine oblique Mercator projection (variant B) on the datum of ``crs``, in metres.

    References
    ----------
    PROJ, "Oblique Mercator" (omerc): ``alpha`` is the azimuth of the central line, ``gamma`` the angle from the
    rectified to the skew grid. With gamma = 0, the second axis points along the central line. In PROJ, this holds only
    for alpha from -90 to 90 degrees; for other headings, alpha is the opposite direction and gamma is 180 degrees.
    """
    from pyproj.crs import ProjectedCRS
    from pyproj.crs.coordinate_operation import HotineObliqueMercatorBConversion

    longitude, latitude = transformer(crs, crs.geodetic_crs).transform(*place)
    azimuth, gamma = (heading_deg + 180.0) % 360.0 - 180.0, 0.0
    if not -90.0 < azimuth <= 90.0:
        azimuth, gamma = azimuth - math.copysign(180.0, azimuth), 180.0
    line = HotineObliqueMercatorBConversion(
        latitude_projection_centre=latitude,
        longitude_projection_centre=longitude,
        azimuth_projection_centre=azimuth,
        angle_from_rectified_to_skew_grid=gamma,
    )
    return ProjectedCRS(line, name=f"track of heading {heading_deg:g} degrees", geodetic_crs=crs.geodetic_crs)


def vertical_unit(crs: CRS) -> str | None:
    """Unit of heights in a CRS, or None if the CRS has no vertical axis."""
    axes = crs.axis_info if not crs.is_bound or crs.source_crs is None else crs.source_crs.axis_info
    return next((axis.unit_name for axis in axes if axis.direction.lower() in ("up", "down")), None)


def unit_in_metadata(metadata: Mapping[str, str], description: str | None) -> str | None:
    """Unit of heights other than metres that a raster's metadata or the description of its band names.

    Parameters
    ----------
    metadata : mapping
        Metadata of the raster and its band. Keys such as ``Vertical Units``, ``ELEVATION_UNITS`` or ``zUnit`` are read.
    description : str or None
        Description of the band, which may end with a unit in brackets, as in ``elevation (ft)``.

    Returns
    -------
    str or None
        The unit as written; None if metadata and description name metres, an unknown unit, or no unit.
    """
    named = [text for key, text in metadata.items() if _UNIT_KEYS.fullmatch(re.sub(r"[^a-z]", "", key.lower()))]
    named += re.findall(r"[(\[]([^()\[\]]*)[)\]]\s*$", description or "")
    return next((text for text in named if _OTHER_UNITS.fullmatch(re.sub(r"[^a-z ]", "", text.lower()).strip())), None)


def vertical_datum(crs: CRS) -> str | None:
    """Name of the vertical datum of a CRS, or None if the CRS names no vertical datum.

    Parameters
    ----------
    crs : pyproj.CRS
        CRS of the file.

    Returns
    -------
    str or None
        For a compound CRS, the name of its vertical CRS, such as ``EGM96 height``. For a three-dimensional CRS, the
        name of its ellipsoid, such as ``WGS 84 ellipsoid``.
    """
    if crs.is_compound:
        vertical = crs.sub_crs_list[-1]
        names = (vertical.name, vertical.datum.name if vertical.datum is not None else "")
        # a GeoTIFF may name a unit of heights but no vertical datum; libraries then call the datum "unknown"
        return next((name for name in names if name.lower() not in _UNNAMED), None)
    if len(crs.axis_info) == 3:
        return f"{crs.ellipsoid.name if crs.ellipsoid is not None else crs.name} ellipsoid"
    return None


def named_datum(text: str) -> str:
    """Standard name of the vertical datum that the configuration gives as ``scene.vertical_datum``.

    Parameters
    ----------
    text : str
        Value of the key: a name in the EPSG database, with or without the word "height" (EGM96, EGM2008, NAP); a code
        of this database (EPSG:5773); an ellipsoid (WGS84 ellipsoid); or ``local``.

    Returns
    -------
    str
        Name of the datum in the EPSG database; the unchanged value for an ellipsoid or ``local``.

    Raises
    ------
    SceneError
        The EPSG database has no vertical datum of this name or code.
    """
    import pyproj

    if re.fullmatch(r"[A-Za-z]+:\d+", text.strip()):
        try:
            crs = pyproj.CRS.from_user_input(text.strip())
        except pyproj.exceptions.CRSError:
            raise SceneError(f"scene.vertical_datum is {text!r}, which is not a known CRS.") from None
        name = crs.name if crs.type_name == "Vertical CRS" else vertical_datum(crs)
        if name is None:
            raise SceneError(f"scene.vertical_datum is {text!r} ({crs.name}), which says nothing about heights.")
        return name
    if "ellips" in text.lower() or _key(text) == "local":
        return text.strip()
    known = _vertical_crs()
    if _key(text) not in known:
        near = difflib.get_close_matches(_key(text), known, n=1, cutoff=0.6)
        meant = f" (did you mean {known[near[0]].name!r}?)" if near else ""
        raise SceneError(
            f"scene.vertical_datum is {text!r}{meant}, expected a vertical datum of the EPSG database such as EGM96, "
            "EGM2008 or NAP, WGS84 ellipsoid, or local."
        )
    return str(known[_key(text)].name)


@functools.cache
def _vertical_crs() -> dict[str, Any]:
    """Name and code of the vertical CRSs of the EPSG database, by key; the search of the database takes 0.1 s."""
    import pyproj

    known: dict[str, Any] = {}
    vertical = pyproj.database.query_crs_info("EPSG", pyproj.enums.PJType.VERTICAL_CRS)
    # shortest name first, because longer names add the unit
    for info in sorted(vertical, key=lambda info: len(info.name)):
        known.setdefault(_key(info.name), info)
    return known


def same_datum(one: str, other: str) -> bool:
    """Whether two names denote the same vertical datum; only the names are compared."""
    keys = {_key(one), _key(other)}
    return len(keys) == 1 or ("ellipsoid" in keys and all("ellipsoid" in key for key in keys))


def _key(name: str) -> str:
    """Name of a datum without words that are often omitted: "EGM96 height" and "EGM96_Geoid" give the same text."""
    text = re.sub(r"\(.*?\)|height|geoid(?!al)|vertical|datum", "", name.lower()).replace("ellipsoidal", "ellipsoid")
    return re.sub(r"[^a-z0-9]", "", text)


def transformation_findings(source: CRS, target: CRS, name: str) -> list[Finding]:
    """Finding on coordinates that are less accurate because a datum-shift grid is missing; else empty.

    Parameters
    ----------
    source, target : pyproj.CRS
        Horizontal CRSs.
    name : str
        Name of the transformed data.
    """
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the finding below replaces this warning
        group = TransformerGroup(source, target, always_xy=True)
    if group.best_available or not group.transformers:
        return []
    numbers: dict[str, float | str] = {"source": source.name, "target": target.name}
    accuracy_m = group.transformers[0].accuracy
    if accuracy_m < 0:
        return [Finding("transformation_unknown", "note", name, numbers)]
    return [Finding("transformation", "note", name, {**numbers, "accuracy_m": accuracy_m})]


def geoid_m(datum: str, longitude_deg: float, latitude_deg: float) -> float | None:
    """Height [m] of the zero level of a vertical datum above the WGS 84 ellipsoid, at a given place.

    Parameters
    ----------
    datum : str
        Name of the datum, as in :attr:`.Scene.vertical_datum`.
    longitude_deg, latitude_deg : float
        Longitude and latitude of the place on WGS 84 [deg].

    Returns
    -------
    float or None
        Height [m]; 0 for an ellipsoid. None if the grid of the geoid is not installed or does not cover the place, or
        if the datum is not in the EPSG database.
    """
    import pyproj

    if "ellips" in datum.lower():
        return 0.0
    info = _vertical_crs().get(_key(datum))
    if info is None:
        return None
    datum_crs = pyproj.CRS.from_authority(info.auth_name, info.code)
    above, ellipsoid = pyproj.crs.CompoundCRS("heights", ["EPSG:4326", datum_crs]), pyproj.CRS.from_epsg(4979)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if not pyproj.transformer.TransformerGroup(above, ellipsoid, always_xy=True).best_available:
            return None
    try:
        change = pyproj.Transformer.from_crs(above, ellipsoid, always_xy=True)
        return float(change.transform(longitude_deg, latitude_deg, 0.0, errcheck=True)[2])
    except pyproj.exceptions.ProjError:
        return None


def pixel_size_m(raster: Any, plane: CRS) -> tuple[float, float]:
    """Size on the ground of the middle pixel of an open raster [m]: width along a row, and height along a column.

    Parameters
    ----------
    raster : rasterio.DatasetReader
        Raster with a transform.
    plane : pyproj.CRS
        Horizontal CRS of the raster. With a geographic CRS, the lengths are geodesics of WGS84 (:class:`pyproj.Geod`).
    """
    from pyproj import Geod

    t = raster.transform
    if not plane.is_geographic:
        unit = plane.axis_info[0].unit_conversion_factor if plane.axis_info[0].unit_name not in METRES else 1.0
        return float(math.hypot(t.a, t.d) * unit), float(math.hypot(t.b, t.e) * unit)
    column, row = raster.width / 2, raster.height / 2
    x, y = t.c + t.a * column + t.b * row, t.f + t.d * column + t.e * row
    geod = Geod(ellps="WGS84")
    return float(geod.inv(x, y, x + t.a, y + t.d)[2]), float(geod.inv(x, y, x + t.b, y + t.e)[2])


def earth_radius_m(crs: str, place: tuple[float, float], azimuth_deg: float) -> float:
    """Radius of curvature of the ellipsoid at a place, along a given direction.

    Parameters
    ----------
    crs : str
        Projected CRS, with its ellipsoid.
    place : (float, float)
        Coordinates of the place in the CRS [m].
    azimuth_deg : float
        Direction, clockwise from north [deg].

    Returns
    -------
    float
        Radius of the normal section [m], by Euler's formula from the radii of the meridian and of the prime vertical.

    References
    ----------
    Torge and Mueller, "Geodesy" (4th edition, 2012), section 4.1.3.
    """
    from pyproj import CRS

    plane = CRS.from_user_input(crs)
    _, latitude = transformer(plane, plane.geodetic_crs).transform(*place)
    ellipsoid = plane.ellipsoid
    assert ellipsoid is not None  # noqa: S101 - every geodetic datum has an ellipsoid
    major, ratio = ellipsoid.semi_major_metre, 1.0 - (ellipsoid.semi_minor_metre / ellipsoid.semi_major_metre) ** 2
    root = math.sqrt(1.0 - ratio * math.sin(math.radians(latitude)) ** 2)
    meridian, vertical = major * (1.0 - ratio) / root**3, major / root
    azimuth = math.radians(azimuth_deg)
    return 1.0 / (math.cos(azimuth) ** 2 / meridian + math.sin(azimuth) ** 2 / vertical)


def ground_per_grid(crs: str, place: tuple[float, float], direction: tuple[float, float]) -> float:
    """Distance on the ellipsoid per distance in a grid, at a place and along a direction: inverse of the scale factor.

    Parameters
    ----------
    crs : str
        Projected CRS.
    place : (float, float)
        Coordinates of the place in the CRS [m].
    direction : (float, float)
        Direction in the CRS, a vector of any length.

    Returns
    -------
    float
        Ratio of a geodesic to its length in the grid, over 2 km about the place.

    References
    ----------
    Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987), chapter 4: scale factor.
    """
    from pyproj import CRS

    plane = CRS.from_user_input(crs)
    half = _HALF_M / math.hypot(*direction)
    x, y = ([p - half * v, p + half * v] for p, v in zip(place, direction, strict=True))
    longitude, latitude = transformer(plane, plane.geodetic_crs).transform(x, y)
    geod = plane.get_geod()
    assert geod is not None  # noqa: S101 - every geodetic datum has an ellipsoid
    return float(geod.inv(longitude[0], latitude[0], longitude[1], latitude[1])[2]) / (2.0 * _HALF_M)

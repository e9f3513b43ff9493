"""Land-cover maps whose codes have known names, and starting laws for materials with these names.

A starting law only gives starting values. A starting law is one constant gamma for a kind of terrain and one band,
whatever the polarisation, season and moisture. A calibration replaces the starting law. A material with fixed
parameters keeps the starting law, so that its level may be wrong by many dB.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from radcal.laws import DEFAULT_LAW

__all__ = [
    "BRIGHTEST_DB",
    "LANDCOVERS",
    "Cover",
    "LandCover",
    "StartingLevel",
    "landcover_table",
    "starting_keys",
    "starting_levels",
]

LandCover = Literal["esa_worldcover", "corine", "nlcd"]

# gamma [dB] of kinds of terrain at 10 GHz, as listed by the function surfacegamma of MathWorks' Phased Array System #
# Toolbox: woods, metropolitan and sea state 3 after Long, "Radar Reflectivity of Land and Sea", 3rd edition, Artech
# House (2001); farmland and flatland after Nathanson, "Radar Design Principles", 2nd edition, SciTech (1999)
_GAMMA_DB = {"woods": -15.0, "metropolitan": 0.0, "farmland": -15.0, "flatland": -20.0, "sea state 3": -40.0}
BRIGHTEST_DB = max(_GAMMA_DB.values())
"""Largest gamma of these kinds of terrain [dB]."""

# X1 + X2 cos(phi) is 10 log10(cos(phi)) within 0.2 dB from 20 to 60 degrees (least squares)
_LINE_DB = (-5.86, 6.05)
_BELOW_DB, _ABOVE_DB = 30.0, 15.0  # bounds of X1 about gamma; those of X2 to X4 are the default case's
_BOUNDS = [[0.0, 16.0], [0.0, 22.0], [0.0, 12.0]]
_X4 = 4.0
# words in material names that show the kind of terrain, for names that no land-cover map contains
_WORDS = {
    "woods": "forests? trees? woods? woodlands? mangroves? scrub shrubs? shrubland",
    "metropolitan": "urban built buildings? developed city houses? settlements? harbours? ports?",
    "farmland": "crops? croplands? arable cultivated farmland agriculture grass grasses grasslands? pastures? meadows? "
    "wheat barley rye oats? maize corn rice beets? potato(es)? rapeseed peas? beans? vineyards?",
    "flatland": "bare soil sands? barren rocks? beach(es)? desert snow ice roads? runways? airports?",
    "sea state 3": "water sea ocean lakes? rivers? lagoons?",
}
_APART_DB = 3.0  # smallest difference of two starting levels, so that the start image shows where the materials meet
_UNKNOWN_DB = -15.0  # gamma if neither the name nor the map shows the terrain


@dataclass(frozen=True)
class StartingLevel:
    """Level from which the law of a material starts in a new case.

    Attributes
    ----------
    gamma_db : float
        Constant gamma [dB].
    terrain : str or None
        Kind of terrain that has this gamma; None if the kind is unknown.
    moved : bool
        Whether the level was moved away from that of another material.
    """

    gamma_db: float
    terrain: str | None
    moved: bool

    def start(self, lowest_db: float, highest_db: float) -> list[float]:
        """Parameters of the default law that approximate the level's constant gamma, with X1 inside its bounds [dB]."""
        first = min(max(self.gamma_db + _LINE_DB[0], lowest_db), highest_db)
        return [round(first, 2), _LINE_DB[1], 0.0, _X4]

    def __str__(self) -> str:
        said = "of no known kind" if self.terrain is None else f"of {self.terrain}"
        return f"gamma {self.gamma_db:g} dB {said}" + ", moved apart from another material" * self.moved


@dataclass(frozen=True)
class Cover:
    """Class of a land-cover map.

    Attributes
    ----------
    name : str
        Name of the material.
    terrain : str
        Kind of terrain whose gamma starts its law.
    taken_for : bool
        Whether the source of the gammas has no value for this class, so that the gamma of a similar terrain is used.
    """

    name: str
    terrain: str
    taken_for: bool = False


_FOREST, _CROPS, _URBAN, _WATER = "woods", "farmland", "metropolitan", "sea state 3"


def _covers(*classes: tuple[int, str, str, bool]) -> dict[int, Cover]:
    return {code: Cover(name, terrain, taken_for) for code, name, terrain, taken_for in classes}


LANDCOVERS: Mapping[str, Mapping[int, Cover]] = {
    # ESA WorldCover product user manual, version 2.0, table of classes
    "esa_worldcover": _covers(
        (10, "tree_cover", _FOREST, False),
        (20, "shrubland", _FOREST, True),
        (30, "grassland", _CROPS, True),
        (40, "cropland", _CROPS, False),
        (50, "built_up", _URBAN, False),
        (60, "bare_sparse_vegetation", "flatland", False),
        (70, "snow_and_ice", "flatland", True),
        (80, "permanent_water_bodies", _WATER, True),
        (90, "herbaceous_wetland", _CROPS, True),
        (95, "mangroves", _FOREST, False),
        (100, "moss_and_lichen", "flatland", True),
    ),
    # CORINE nomenclature, 44 classes in the order of their codes 111 to 523, which is that of the raster's values
    "corine": _covers(
        (1, "continuous_urban_fabric", _URBAN, False),
        (2, "discontinuous_urban_fabric", _URBAN, False),
        (3, "industrial_or_commercial_units", _URBAN, False),
        (4, "road_and_rail_networks", "flatland", True),
        (5, "port_areas", _URBAN, False),
        (6, "airports", "flatland", False),
        (7, "mineral_extraction_sites", "flatland", True),
        (8, "dump_sites", "flatland", True),
        (9, "construction_sites", _URBAN, True),
        (10, "green_urban_areas", _CROPS, True),
        (11, "sport_and_leisure_facilities", _CROPS, True),
        (12, "non-irrigated_arable_land", _CROPS, False),
        (13, "permanently_irrigated_land", _CROPS, False),
        (14, "rice_fields", _CROPS, False),
        (15, "vineyards", _CROPS, False),
        (16, "fruit_trees_and_berry_plantations", _FOREST, False),
        (17, "olive_groves", _FOREST, False),
        (18, "pastures", _CROPS, True),
        (19, "annual_crops_with_permanent_crops", _CROPS, False),
        (20, "complex_cultivation_patterns", _CROPS, False),
        (21, "agriculture_with_natural_vegetation", _CROPS, False),
        (22, "agro-forestry_areas", _FOREST, False),
        (23, "broad-leaved_forest", _FOREST, False),
        (24, "coniferous_forest", _FOREST, False),
        (25, "mixed_forest", _FOREST, False),
        (26, "natural_grasslands", _CROPS, True),
        (27, "moors_and_heathland", _CROPS, True),
        (28, "sclerophyllous_vegetation", _FOREST, True),
        (29, "transitional_woodland-shrub", _FOREST, False),
        (30, "beaches_dunes_sands", "flatland", False),
        (31, "bare_rocks", "flatland", True),
        (32, "sparsely_vegetated_areas", "flatland", False),
        (33, "burnt_areas", "flatland", True),
        (34, "glaciers_and_perpetual_snow", "flatland", True),
        (35, "inland_marshes", _CROPS, True),
        (36, "peat_bogs", _CROPS, True),
        (37, "salt_marshes", _CROPS, True),
        (38, "salines", "flatland", True),
        (39, "intertidal_flats", "flatland", True),
        (40, "water_courses", _WATER, True),
        (41, "water_bodies", _WATER, True),
        (42, "coastal_lagoons", _WATER, True),
        (43, "estuaries", _WATER, True),
        (44, "sea_and_ocean", _WATER, False),
    ),
    # National Land Cover Database (USGS), class legend; 51 and 72 to 74 occur in Alaska alone
    "nlcd": _covers(
        (11, "open_water", _WATER, True),
        (12, "perennial_ice_snow", "flatland", True),
        (21, "developed_open_space", _CROPS, True),
        (22, "developed_low_intensity", _URBAN, False),
        (23, "developed_medium_intensity", _URBAN, False),
        (24, "developed_high_intensity", _URBAN, False),
        (31, "barren_land", "flatland", False),
        (41, "deciduous_forest", _FOREST, False),
        (42, "evergreen_forest", _FOREST, False),
        (43, "mixed_forest", _FOREST, False),
        (51, "dwarf_scrub", _CROPS, True),
        (52, "shrub_scrub", _FOREST, True),
        (71, "grassland_herbaceous", _CROPS, True),
        (72, "sedge_herbaceous", _CROPS, True),
        (73, "lichens", "flatland", True),
        (74, "moss", "flatland", True),
        (81, "pasture_hay", _CROPS, True),
        (82, "cultivated_crops", _CROPS, False),
        (90, "woody_wetlands", _FOREST, True),
        (95, "emergent_herbaceous_wetlands", _CROPS, True),
    ),
}
"""Classes of each land-cover map, by the code of the class."""


def starting_keys(landcover: str, name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a material that follow from the starting law of its land-cover class and are missing in the case.

    Parameters
    ----------
    landcover : str
        Name of the land-cover map.
    name : str
        Material.
    given : mapping
        Keys of the material in the case.

    Returns
    -------
    dict
        Keys and values. A fixed material gets the law of constant gamma. A calibrated material gets bounds of the
        default law, and as start the parameters that approximate constant gamma. The dict is empty if the case gives
        another law, fixed parameters or bounds, and for a name that the map does not contain.
    """
    cover = next((cover for cover in LANDCOVERS.get(landcover, {}).values() if cover.name == name), None)
    if cover is None or given.get("law", DEFAULT_LAW) != DEFAULT_LAW:
        return {}
    gamma = _GAMMA_DB[cover.terrain]
    if not given.get("calibrate"):
        return {} if "law" in given or "parameters" in given else {"law": "constant_gamma", "parameters": [gamma]}
    if "bounds" in given:
        return {}
    bounds = {"bounds": [[gamma - _BELOW_DB, gamma + _ABOVE_DB], *_BOUNDS]}
    start = {"start": [gamma + _LINE_DB[0], _LINE_DB[1], 0.0, _X4]}
    return bounds if "start" in given else {**bounds, **start}


def starting_levels(
    names: Sequence[str], taken_db: Iterable[float] = (), unknown_db: float = _UNKNOWN_DB
) -> dict[str, StartingLevel]:
    """Starting levels of the laws of several materials, at least 3 dB apart from each other.

    A measured image is registered onto the simulated start image. The start image shows the border of two materials
    only if their levels differ. The registration does not depend on the sign of the contrast between two materials.

    Parameters
    ----------
    names : sequence of str
        Names of the materials. The kind of terrain follows from a name that a land-cover map contains, or from a word
        in the name.
    taken_db : iterable of float
        Gamma of other materials [dB], from which the new levels differ by at least 3 dB.
    unknown_db : float
        Gamma of a material whose name does not show its kind of terrain [dB].
    """
    used, found = list(taken_db), dict[str, StartingLevel]()
    for name in names:
        terrain = _terrain(name)
        level = unknown_db if terrain is None else _GAMMA_DB[terrain]
        steps = (sign * k * _APART_DB for k in itertools.count() for sign in ((1.0, -1.0) if k else (1.0,)))
        away = next(step for step in steps if all(abs(level + step - other) >= _APART_DB for other in used))
        used.append(level + away)
        found[name] = StartingLevel(level + away, terrain, away != 0.0)
    return found


def _terrain(name: str) -> str | None:
    """Kind of terrain that follows from the name of a material; None if the name does not show it."""
    covers = (cover for classes in LANDCOVERS.values() for cover in classes.values())
    if (known := next((cover.terrain for cover in covers if cover.name == name), None)) is not None:
        return known
    words = re.split(r"[^A-Za-z]+", name.lower())
    for terrain, patterns in _WORDS.items():
        if any(re.fullmatch(pattern, word) for pattern in patterns.split() for word in words):
            return terrain
    return None


def landcover_table(landcover: str) -> str:
    """Markdown table of the classes of a land-cover map, for ``docs/landcover.md``."""
    lines = ["| code | material | starting gamma [dB] | terrain of the source |", "|---|---|---|---|"]
    for code, cover in LANDCOVERS[landcover].items():
        taken = " (taken for it)" if cover.taken_for else ""
        lines.append(f"| {code} | `{cover.name}` | {_GAMMA_DB[cover.terrain]:g} | {cover.terrain}{taken} |")
    return "\n".join(lines) + "\n"

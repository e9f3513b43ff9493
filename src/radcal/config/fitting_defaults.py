"""Default values that depend on other keys of a case, inserted into the data before the models check the data."""

from __future__ import annotations

from typing import Any

from radcal.laws import DEFAULT_LAW, LAWS
from radcal.sections.base import TAGS
from radcal.sections.errors import Wrong
from radcal.sections.measurement import SyntheticMeasurement, default_synthetic, hidden_dyke, within
from radcal.sections.objectives import DEFAULT, OBJECTIVES
from radcal.tables import read_table
from radcal.tables.landcover import starting_keys

_DRAWS_IN_BINS = 4


def _kind(data: dict[str, Any]) -> Any:
    simulator = data.get("simulator")
    return simulator.get(TAGS["simulator"]) if isinstance(simulator, dict) else None


def with_fitting_stop(data: dict[str, Any]) -> dict[str, Any]:
    """Case data in which ``stop.at_sampling_error`` is true by default for an external program without ``stop.rms``."""
    stop = data.get("stop", {})
    if not isinstance(stop, dict) or "rms" in stop or "at_sampling_error" in stop:
        return data
    return {**data, "stop": {**stop, "at_sampling_error": True}} if _kind(data) == "command" else data


def with_fitting_draws(data: dict[str, Any]) -> dict[str, Any]:
    """Case data with ``simulator.draws`` 4 by default, for the built-in simulator with incidence-angle bins."""
    simulator, objective = data.get("simulator", {}), data.get("objective", DEFAULT)
    bins = isinstance(objective, str) and objective in OBJECTIVES and OBJECTIVES[objective].bins
    if not isinstance(simulator, dict) or "draws" in simulator or not bins:
        return data
    if simulator.get(TAGS["simulator"], "builtin") != "builtin":
        return data
    return {**data, "simulator": {**simulator, TAGS["simulator"]: "builtin", "draws": _DRAWS_IN_BINS}}


def with_fitting_measurement(data: dict[str, Any]) -> dict[str, Any]:
    """Case data with the default case's measurement, for a case with the default scene, materials and simulator."""
    if "materials" in data:
        return _with_fitting_truth(data)
    if _kind(data) == "command" or any(section in data for section in ("measurement", "scene")):
        return data
    return {**data, "measurement": SyntheticMeasurement(synthetic=default_synthetic())}


def _with_fitting_truth(data: dict[str, Any]) -> dict[str, Any]:
    """Case data with the dyke's published hidden law, if the configured bounds contain it but not the default one."""
    materials = data["materials"]
    dyke = materials.get("dyke") if isinstance(materials, dict) else None
    if not isinstance(dyke, dict) or not dyke.get("calibrate") or dyke.get("law", DEFAULT_LAW) != DEFAULT_LAW:
        return data
    box = dyke.get("bounds") or LAWS[DEFAULT_LAW].bounds
    published = read_table("demonstration")["published_dyke"]
    if within(hidden_dyke(), box) or not within(published, box):
        return data
    given = data.get("measurement", {})
    each = given if isinstance(given, list) else [given]
    return {**data, "measurement": [_with_truth(one, published) for one in each]}


def _with_truth(measurement: Any, hidden: list[float]) -> Any:
    """Section of a synthetic measurement with the published hidden law, unless the section gives hidden laws itself."""
    if not isinstance(measurement, dict) or measurement.get(TAGS["measurement"], "synthetic") != "synthetic":
        return measurement
    synthetic = measurement.get("synthetic", {})
    if not isinstance(synthetic, dict) or "parameters" in synthetic or "dyke" in (synthetic.get("laws") or {}):
        return measurement
    tag = {TAGS["measurement"]: "synthetic"}
    return {**tag, **measurement, "synthetic": {**synthetic, "parameters": {"dyke": list(hidden)}}}


def with_starting_laws(data: dict[str, Any]) -> dict[str, Any]:
    """Case data with starting laws for materials that a land-cover map names and for which the case gives no law."""
    scene, materials = data.get("scene"), data.get("materials")
    landcover = scene.get("landcover") if isinstance(scene, dict) else None
    if not isinstance(landcover, str) or not isinstance(materials, dict):
        return data
    found = {
        name: {**item, **starting_keys(landcover, name, item)} if isinstance(item, dict) else item
        for name, item in materials.items()
    }
    return {**data, "materials": found}


def with_colours(data: dict[str, Any]) -> dict[str, Any]:
    """Case data with a section ``colours`` of the materials' colours, which only the stage ``archive`` reads."""
    if data.get("colours") is not None:
        raise Wrong("colours", ": unknown key, expected a key colour in each material")
    materials = data.get("materials")
    if not isinstance(materials, dict):
        return data
    colours = {
        name: item["colour"]
        for name, item in materials.items()
        if isinstance(item, dict) and isinstance(item.get("colour"), str)
    }
    return {**data, "colours": colours} if colours else data

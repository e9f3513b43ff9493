"""Default values that depend on other keys of a case."""

from __future__ import annotations

from typing import Any

from radcal.config.part import Part
from radcal.laws import DEFAULT_LAW, EXTERNAL
from radcal.sections.errors import Wrong
from radcal.sections.measurement import (
    MeasurementConfig,
    SyntheticMeasurement,
    default_synthetic,
    hidden_dyke,
    within,
)
from radcal.sections.objectives import OBJECTIVES, SINGLE
from radcal.tables import read_table
from radcal.tables.landcover import starting_keys

_DRAWS_IN_BINS = 4


def with_starting_laws(data: dict[str, Any]) -> dict[str, Any]:
    """Case data with starting laws for materials that a land-cover map names and for which the case gives no law."""
    if data.get("colours") is not None:
        raise Wrong("colours", ": unknown key, expected a key colour in each material")
    scene, materials = data.get("scene"), data.get("materials")
    landcover = scene.get("landcover") if isinstance(scene, dict) else None
    if not isinstance(landcover, str) or not isinstance(materials, dict):
        return data
    found = {
        name: {**item, **starting_keys(landcover, name, item)} if isinstance(item, dict) else item
        for name, item in materials.items()
    }
    return {**data, "materials": found}


def fitting_defaults(case: Part) -> dict[str, Any]:
    """Sections that other keys of a case change where the case does not give them.

    A missing ``objective`` becomes ``density`` if the case has a single incidence-angle bin, normalisation ``image`` or
    a calibrated material with law ``external``. ``stop.at_sampling_error`` is true for an external program without
    ``stop.rms``, and ``simulator.draws`` is 4 for the built-in simulator with incidence-angle bins. A case with the
    default scene, materials and simulator has the default case's measurement. Section ``colours``, which only the stage
    ``archive`` reads, has the materials' colours.
    """
    found: dict[str, Any] = {}
    given, simulator, target = case.model_fields_set, case.simulator, case.target
    if "materials" in given:
        found["measurements"] = [_with_truth(case, one) for one in case.measurements]
    elif simulator.kind != "command" and not given & {"measurements", "scene"}:
        found["measurements"] = [SyntheticMeasurement(synthetic=default_synthetic())]
    outside = any(one.calibrate and one.law == EXTERNAL for one in case.materials.values())
    if "objective" not in given and (target.incidence_classes == 1 or target.normalisation == "image" or outside):
        found["objective"] = SINGLE
    if simulator.kind == "command" and not case.stop.model_fields_set & {"rms", "at_sampling_error"}:
        found["stop"] = case.stop.model_copy(update={"at_sampling_error": True})
    bins = OBJECTIVES[found.get("objective", case.objective)].bins
    if simulator.kind == "builtin" and bins and "draws" not in simulator.model_fields_set:
        found["simulator"] = simulator.model_copy(update={"draws": _DRAWS_IN_BINS})
    if colours := {name: one.colour for name, one in case.materials.items() if one.colour is not None}:
        found["colours"] = colours
    return found


def _with_truth(case: Part, measurement: MeasurementConfig) -> MeasurementConfig:
    """Synthetic measurement with the dyke's published hidden law, if the bounds contain it but not the default one."""
    dyke = case.materials.get("dyke")
    if not isinstance(measurement, SyntheticMeasurement) or dyke is None:
        return measurement
    synthetic, published = measurement.synthetic, read_table("demonstration")["published_dyke"]
    free = dyke.calibrate and dyke.law == DEFAULT_LAW and not (synthetic.is_written or "dyke" in synthetic.laws)
    if not free or within(hidden_dyke(), dyke.box) or not within(published, dyke.box):
        return measurement
    changed = synthetic.model_copy(update={"parameters": {"dyke": list(published)}})
    return measurement.model_copy(update={"synthetic": changed})

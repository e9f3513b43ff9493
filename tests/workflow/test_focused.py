"""A calibration whose runs are images focused from raw signals."""

import json

import h5py
import numpy as np
from raster_files import write_raster
from rasterio.transform import from_origin

GAMMA = {"law": "constant_gamma", "bounds": [[-20, 0]], "start": [-14.0]}


def test_a_calibration_on_focused_images_finds_the_law_that_the_fast_image_has(project):
    """Level fields of two laws on the map; the measured image is the fast one, with speckle of its own."""
    profile = {"crs": "EPSG:32631", "transform": from_origin(600_000.0, 5_780_000.0, 4.0, 4.0)}
    write_raster(project.folder / "elevation.tif", np.zeros((48, 48), np.float32), **profile)
    cover = np.where(np.arange(48) < 24, 1, 2).astype(np.uint8) * np.ones((48, 1), np.uint8)
    write_raster(project.folder / "cover.tif", cover, **profile)
    files = {"elevation": "elevation.tif", "materials": "cover.tif", "names": "names.json"}
    case = {
        "scene": {"source": "raster", "vertical_datum": "EGM2008", **files},
        "radar": {"altitude_m": 1000.0, "looks": 1, "nesz_db": -30.0},
        "simulator": {"kind": "builtin", "product": "focused", "draws": 2},
        "materials": {"field": {"calibrate": True, **GAMMA}, "lake": {"law": "constant_gamma", "parameters": [-18.0]}},
        "measurement": {"synthetic": {"parameters": {"field": [-9.0]}, "seed": 1, "warp_px": 0, "nesz_db": -30.5}},
        "objective": "classes", "design": {"size": 0}, "stop": {"max_runs": 6},
    }  # fmt: skip
    project.write(**case)
    project.ended("--configfile", "tiny.yaml")
    summary = project.summary()
    assert summary["runs"]["design"] == 0  # none is needed beside an analytic prediction
    curve = summary["materials"]["field"]["sigma0_curve"]
    band = [np.array(curve[key], float) for key in ("p05_db", "p95_db")]
    gamma = -9.0 + 10.0 * np.log10(np.cos(np.radians(curve["incidence_deg"])))
    assert np.nanmax(np.abs(curve["median_db"] - gamma)) < 1.5
    assert np.nanmax(band[1] - band[0]) < 4.0
    for path in (project.out() / "runs").glob("[!.]*.h5"):
        with h5py.File(path) as file:
            assert json.loads(file.attrs["description"])["simulator"] == {"kind": "builtin", "version": 3, "focused": 2}
    # one file for each seed: two draws, and the final run with fresh speckle
    parts = sorted((project.out() / "passes/1/focused").iterdir())
    assert len(parts) == 3

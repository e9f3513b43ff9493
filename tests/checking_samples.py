"""A case in slant range that radcal check reads, with its files."""

from pathlib import Path

import numpy as np
from raster_files import write_raster

SLANT_RANGE = """
case: mine
radar: {looks: 4, nesz_db: -40}
scene: {source: slant_range, labels: labels.tif, names: names.json, near_incidence_deg: 20, far_incidence_deg: 40}
measurement: {source: file, path: image.npy, scale: power, radiometry: sigma0_ref}
materials:
  field: {calibrate: true, law: mangia, bounds: [[-40, 0], [0, 30], [0, 20], [0, 20]]}
  lake: {law: mangia, parameters: [-4, 3, 2, 6]}
simulator: {kind: builtin}
target: {pixels: 300}
design: {size: 3}
stop: {max_runs: 12}
uncertainty: {walkers: 32, steps: 100}
"""


def slant_range(shape=(60, 50)):
    """Write the case and its files into the current folder."""
    write_raster("labels.tif", np.where(np.arange(50) < 20, 1, 2).astype(np.uint8)[None].repeat(60, axis=0))
    Path("names.json").write_text('{"1": "field", "2": "lake"}')
    np.save("image.npy", np.random.default_rng(3).gamma(4.0, 0.25, shape).astype(np.float32))
    Path("mine.yaml").write_text(SLANT_RANGE)
    return Path("mine.yaml")

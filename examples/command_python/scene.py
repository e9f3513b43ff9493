"""Write the example's scene into data/: labels and their names."""

import json
import warnings
from pathlib import Path

import numpy as np
import rasterio

FOLDER = Path(__file__).parent / "data"
FOLDER.mkdir(exist_ok=True)
labels = np.ones((64, 60), dtype=np.uint8)
labels[:, 45:] = 2
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it lies in slant range, on no map
    profile = {"driver": "GTiff", "height": labels.shape[0], "width": labels.shape[1], "count": 1, "dtype": "uint8"}
    with rasterio.open(FOLDER / "labels.tif", "w", **profile) as raster:
        raster.write(labels, 1)
(FOLDER / "names.json").write_text(json.dumps({"1": "soil", "2": "water"}))

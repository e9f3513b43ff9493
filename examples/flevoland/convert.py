"""Convert an AIRSAR coherency matrix of Flevoland and its labels to the files of ``config/flevoland.yaml``.

``convert.py FOLDER`` reads ``T3/*.bin`` (ENVI) and ``Flevoland_gt.mat`` from FOLDER, and writes ``flevoland/`` to the
current folder. HH = (T11 + T22) / 2 + Re T12 [power], by the Pauli basis of the coherency matrix.
"""

import json
import sys
import warnings
from pathlib import Path

import rasterio
import scipy.io

NAMES = (
    "water", "forest", "lucerne", "grass", "rapeseed", "beet", "potatoes", "peas", "stem beans", "bare soil", "wheat",
    "wheat 2", "wheat 3", "barley", "buildings",
)  # fmt: skip

folder, target = Path(sys.argv[1]), Path("flevoland")
target.mkdir(exist_ok=True)
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # the image lies in slant range, on no map
    t11, t22, t12 = (rasterio.open(folder / f"T3/{name}.bin").read(1) for name in ("T11", "T22", "T12_real"))
    labels = scipy.io.loadmat(folder / "Flevoland_gt.mat")["gt"].astype("uint8")
    for name, image in (("sigma0_hh", (t11 + t22) / 2 + t12), ("labels", labels)):
        height, width = image.shape
        profile = {"driver": "GTiff", "height": height, "width": width, "count": 1, "dtype": image.dtype}
        with rasterio.open(target / f"{name}.tif", "w", **profile) as file:
            file.write(image, 1)
(target / "labels.json").write_text(json.dumps({str(k + 1): name for k, name in enumerate(NAMES)}))

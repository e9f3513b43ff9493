"""A small SAR simulator of bare soil, as an example of a program that radcal drives.

``sim.py INPUT GEOMETRY``: INPUT is the JSON file that radcal writes for each run, GEOMETRY
radcal's file of incidence angles and materials. The image goes to the file that INPUT names.

Backscatter from soil moisture mv [m3/m3] and rms height s [cm]: Dubois, van Zyl and Engman,
"Measuring soil moisture with imaging radars", IEEE TGRS 33 (1995), eq. 1 (HH), with the
permittivity of Topp, Davis and Annan, Water Resources Research 16 (1980), eq. 7 inverted.
"""

import json
import sys

import h5py
import numpy as np

WAVELENGTH_CM = 5.66
VERSION = "soil 1.0"


def soil_hh(incidence_rad, mv, s_cm):
    """sigma0 at HH, linear power."""
    permittivity = 3.03 + 9.3 * mv + 146.0 * mv**2 - 76.7 * mv**3
    ks = 2.0 * np.pi / WAVELENGTH_CM * s_cm
    sine, cosine, tangent = np.sin(incidence_rad), np.cos(incidence_rad), np.tan(incidence_rad)
    return (
        10**-2.75 * cosine**1.5 / sine**5
        * 10 ** (0.028 * permittivity * tangent) * (ks * sine) ** 1.4 * WAVELENGTH_CM**0.7
    )  # fmt: skip


def main(input_path, geometry_path):
    """Simulate one image."""
    with open(input_path, encoding="utf-8") as file:
        run = json.load(file)
    with h5py.File(geometry_path) as file:
        material, names = file["material"][()], list(file["names"].asstr()[()])
        incidence = np.radians(file["incidence_deg"][()].astype(float))
    sigma0 = np.full(material.shape, 1e-4)
    for name, parameters in run["parameters"].items():
        inside = material == names.index(name) + 1
        if parameters:
            sigma0[inside] = soil_hh(incidence[inside], mv=parameters["mv"], s_cm=parameters["s"])
    # the same speckle for the same seed, whatever the parameters
    looks = run["radar"]["looks"]
    speckle = np.random.default_rng(run["noise_seed"]).gamma(looks, 1.0 / looks, material.shape)
    np.save(run["output"], 10.0 * np.log10(sigma0 * speckle))


if __name__ == "__main__":
    if sys.argv[1:] == ["--version"]:
        sys.stdout.write(VERSION + "\n")
    else:
        main(*sys.argv[1:])

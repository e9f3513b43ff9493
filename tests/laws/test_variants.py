"""Wrong variants of the laws' formulas, written out again from their publications."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from variants import agrees

from radcal.laws.curves import constant_gamma, mangia, tabulated, ulaby_dobson
from radcal.laws.soil import oh1992

ANGLES = np.array([21.0, 37.0, 58.0])
PHI = np.radians(ANGLES)


def test_curves():
    a, b, c, d = -17.0, 6.5, 9.0, 3.3
    agrees(
        mangia(PHI, [a, b, c, d]),
        a + b * np.cos(PHI) + c * np.exp(-d * PHI**2),
        sine=a + b * np.sin(PHI) + c * np.exp(-d * PHI**2),
        degrees=a + b * np.cos(ANGLES) + c * np.exp(-d * ANGLES**2),
        linear_exponent=a + b * np.cos(PHI) + c * np.exp(-d * PHI),
        order=b + a * np.cos(PHI) + c * np.exp(-d * PHI**2),
    )
    p = (-14.0, 8.0, 2.1, 1.7, 3.2, -0.6)
    agrees(
        ulaby_dobson(PHI, p),
        p[0] + p[1] * np.exp(-p[2] * PHI) + p[3] * np.cos(p[4] * PHI + p[5]),
        squared=p[0] + p[1] * np.exp(-p[2] * PHI**2) + p[3] * np.cos(p[4] * PHI + p[5]),
        phase=p[0] + p[1] * np.exp(-p[2] * PHI) + p[3] * np.cos(p[4] * PHI - p[5]),
        growing=p[0] + p[1] * np.exp(p[2] * PHI) + p[3] * np.cos(p[4] * PHI + p[5]),
    )
    shape = np.cos(PHI)
    agrees(
        constant_gamma(PHI, [-9.0]),
        -9.0 + 10.0 * np.log10(shape),
        amplitude=-9.0 + 20.0 * np.log10(shape),
        gamma0=np.full(3, -9.0),
        inverse=-9.0 - 10.0 * np.log10(shape),
        grazing=-9.0 + 10.0 * np.log10(np.sin(PHI)),
    )
    knots, levels = (20.0, 40.0, 60.0), (-7.0, -13.0, -13.5)
    agrees(
        tabulated(PHI, levels, angles_deg=knots),
        PchipInterpolator(knots, levels)(ANGLES),
        straight=np.interp(ANGLES, knots, levels),
        radians=PchipInterpolator(knots, levels)(np.clip(PHI, *knots[::2])),
        in_cosine=np.interp(-np.cos(PHI), -np.cos(np.radians(knots)), levels),
    )


@pytest.mark.parametrize("polarisation", ["VV", "HH", "HV", "VH"])
def test_soil(polarisation):
    """Oh, Sarabandi and Ulaby (1992), equations 2 to 7; the wavenumber in 1/cm."""
    permittivity, height, frequency = 11.0 - 2.3j, 0.8, 5.3

    def level(phi, k, share=1.0, wave=polarisation, e=permittivity):
        cosine, root = np.cos(phi), np.sqrt(e - np.sin(phi) ** 2)
        horizontal = np.abs((cosine - root) / (cosine + root)) ** 2
        vertical = np.abs((e * cosine - root) / (e * cosine + root)) ** 2
        nadir = np.abs((1.0 - np.sqrt(e)) / (1.0 + np.sqrt(e))) ** 2
        ks = k * height
        p = (1.0 - (2.0 * phi / np.pi) ** (1.0 / (3.0 * nadir)) * np.exp(-ks)) ** 2
        q = 0.23 * np.sqrt(nadir) * (1.0 - np.exp(-ks))
        like = 0.7 * (1.0 - np.exp(-0.65 * ks**1.8)) * cosine**3 / np.sqrt(p) * (vertical + share * horizontal)
        return 10.0 * np.log10(like * {"VV": 1.0, "HH": p}.get(wave, q))

    k = 2.0 * np.pi * frequency / 29.9792458
    same = (polarisation, polarisation[::-1])
    others = {wave: level(PHI, k, wave=wave) for wave in ("VV", "HH", "HV") if wave not in same}
    agrees(
        oh1992(PHI, [11.0, 2.3, height], frequency_ghz=frequency, polarisation=polarisation),
        level(PHI, k),
        **others,
        wavelength=level(PHI, 1.0 / k),
        no_circle=level(PHI, k / (2.0 * np.pi)),
        metres=level(PHI, k / 100.0),
        one_reflectivity=level(PHI, k, share=0.0),
        lossless=level(PHI, k, e=11.0 + 0.0j),
        exchanged=level(PHI, k, e=2.3 - 11.0j),
        grazing=level(0.5 * np.pi - PHI, k),
    )

"""Products whose file names state scale, radiometry and polarisation of the numbers in the file."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class NamedProduct:
    """Properties of the numbers in a file, as the name of the file states them.

    Attributes
    ----------
    called : str
        Name of the product, for messages.
    scale : str
        Scale of the numbers: db, power or amplitude.
    radiometry : str or None
        Radiometry of the numbers; None if the name does not state the radiometry.
    polarisation : str or None
        Transmitted and received polarisation; None if the name does not state the polarisation.
    filtered : bool
        Whether speckle was filtered.
    """

    called: str
    scale: str
    radiometry: str | None
    polarisation: str | None
    filtered: bool = False


# S1x_yy_aaaaaaaaTbbbbbb_ppo_RTCzz_u_defklm_ssss, followed by the polarisation: HyP3's RTC product guide, section
# "Naming Convention"
_HYP3 = re.compile(
    r"S1[A-D]_\w\w_\d{8}T\d{6}_[SD][HV][PRO]_RTC\d+_G_"
    r"(?P<radiometry>[gs])(?P<scale>[pda])[uw](?P<filter>[nf])[ec][dm]_[0-9A-F]{4}_(?P<pol>HH|HV|VH|VV)\.tiff?",
    re.IGNORECASE,
)
# names that the processor s1ard (CEOS-ARD Normalised Radar Backscatter of Sentinel-1) gives to its images
_NRB = re.compile(r"s1[a-d]-\w\w-nrb-.*-(?P<pol>hh|hv|vh|vv)-(?P<radiometry>[gs])-lin\.tiff?", re.IGNORECASE)
# OPERA_L2_RTC-S1_<burst>_<acquisition>_<processing>_<sensor>_<spacing>_<version>_<polarisation>.tif
_OPERA = re.compile(r"OPERA_L2_RTC-S1_.*_(?P<pol>HH|HV|VH|VV)\.tiff?", re.IGNORECASE)
_PRODUCTS = {"a HyP3 RTC product": _HYP3, "a CEOS-ARD NRB product": _NRB, "an OPERA RTC-S1 product": _OPERA}
_SCALES = {"p": "power", "d": "db", "a": "amplitude"}


def named_product(path: str) -> NamedProduct | None:
    """Product to which a file belongs, according to its name; None for other names.

    The radiometry of terrain-flattened sigma0 is None, because no source confirms that it equals one of radcal's
    radiometries.

    Parameters
    ----------
    path : str
        Path as configured; only its last part is used.

    References
    ----------
    Alaska Satellite Facility, HyP3 RTC product guide, naming convention. CEOS-ARD for Synthetic Aperture Radar,
    Normalised Radar Backscatter. OPERA RTC-S1 product specification, JPL D-108758.
    """
    name = path.rpartition("/")[2]
    for called, pattern in _PRODUCTS.items():
        if (match := pattern.fullmatch(name)) is not None:
            found = {"scale": "p", "radiometry": "g", "filter": "n"} | match.groupdict()
            radiometry = "gamma0_rtc" if found["radiometry"].lower() == "g" else None
            filtered = found["filter"].lower() == "f"
            return NamedProduct(called, _SCALES[found["scale"].lower()], radiometry, found["pol"].upper(), filtered)
    return None

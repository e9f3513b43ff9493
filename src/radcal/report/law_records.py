"""Laws in the archive: parameters, with everything needed to evaluate the law as attributes.

The module is separate so that readers of the archive do not import the modules that only its writer needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import h5py
import numpy as np

from radcal.radar.laws import EXTERNAL, Law, law_for

if TYPE_CHECKING:
    from radcal.config import Material, Radar

__all__ = ["put_law", "read_law"]


def put_law(parameters: h5py.Dataset, material: Material, radar: Radar) -> None:
    """Write everything needed to evaluate a law as attributes of its parameters.

    Parameters
    ----------
    parameters : h5py.Dataset
        Parameters of the law, of one or several runs.
    material : Material
        Material with the law, its knots or its parameters' names.
    radar : Radar
        Pass with polarisation and frequency [GHz].
    """
    parameters.attrs["law"] = material.law
    parameters.attrs["polarisation"] = radar.polarisation
    if radar.frequency_ghz is not None:
        parameters.attrs["frequency_ghz"] = radar.frequency_ghz
    if material.angles_deg is not None:
        parameters.attrs["angles_deg"] = material.angles_deg
    if material.law == EXTERNAL:
        text = h5py.string_dtype()  # written explicitly, because there may be no parameter
        parameters.attrs["names"] = np.array(material.parameter_names, dtype=text)
        parameters.attrs["units"] = np.array(material.parameter_units, dtype=text)


def read_law(parameters: h5py.Dataset) -> Law:
    """Read the law that :func:`put_law` wrote.

    Parameters
    ----------
    parameters : h5py.Dataset
        Dataset of the archive: ``laws/<m>``, ``materials/<m>/parameters`` or ``materials/<m>/start``.

    Raises
    ------
    ConfigError
        This version of radcal does not know the law.
    """
    known = parameters.attrs
    return law_for(
        str(known["law"]),
        polarisation=str(known["polarisation"]),
        frequency_ghz=float(known["frequency_ghz"]) if "frequency_ghz" in known else None,
        angles_deg=[float(angle) for angle in known["angles_deg"]] if "angles_deg" in known else None,
        names=[str(name) for name in known["names"]] if "names" in known else None,
        units=[str(unit) for unit in known["units"]] if "units" in known else None,
    )

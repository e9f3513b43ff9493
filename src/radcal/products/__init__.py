"""What is made from a finished calibration or from laws: exports, forward runs, predictions, advice, comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["PRODUCTS", "Product"]


@dataclass(frozen=True)
class Product:
    """What a forward run writes beside its image, made by radcal's own simulator.

    Attributes
    ----------
    adds : str
        What is written, for the help of the command.
    write : str
        Place "package.module:name" of the function that writes it: from a path without suffix and the
        :class:`~radcal.simulators.forward.Forward` of a pass to the paths of the files, and findings.
    check : str, optional
        Place of a function that raises an error, from the configuration of a pass and the scene, before anything is
        simulated.
    """

    adds: str
    write: str
    check: str | None = None


PRODUCTS: Mapping[str, Product | None] = {
    "intensity": None,
    "complex": Product(
        "the complex looks of the image, as HDF5; their phases are random", "radcal.products.simulated:write_looks"
    ),
    "gmti": Product(
        "moving targets found by several channels (section gmti), as GeoJSON and PNG",
        "radcal.gmti.product:write",
        "radcal.gmti.product:check",
    ),
    "iq": Product("raw signals, as CPHD", "radcal.signals.cphd:write_iq", "radcal.signals.cphd:check_iq"),
    "focused": Product(
        "the complex looks of an image focused from raw signals, as HDF5, and its picture",
        "radcal.signals.focus:write_focused",
        "radcal.signals.focus:check",
    ),
    "ppi": Product(
        "one turn of a surveillance radar on a mast (section ppi), as HDF5 and PNG",
        "radcal.ppi.product:write",
        "radcal.ppi.product:check",
    ),
}
"""Products of ``radcal simulate`` by name; None is the image alone, which every simulator gives."""

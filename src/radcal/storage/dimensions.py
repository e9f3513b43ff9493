"""Labels and scales of the dimensions of HDF5 datasets.

References
----------
The HDF Group, "HDF5 Dimension Scale Specification and Design Notes" (2005).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import h5py

__all__ = ["attach_scales", "label_dimensions"]


def label_dimensions(made: h5py.Dataset | h5py.Group, labels: Sequence[str]) -> None:
    """Label the dimensions of a dataset, if there is one label for each dimension."""
    if isinstance(made, h5py.Dataset) and len(labels) == made.ndim:
        for place, label in enumerate(labels):
            made.dims[place].label = label


def attach_scales(group: h5py.Group, fields: Mapping[str, tuple[Sequence[str], bool]]) -> None:
    """Turn some datasets of a group into dimension scales, and attach each scale to the dimensions with its label.

    Parameters
    ----------
    group : h5py.Group
        Group that contains the datasets.
    fields : mapping
        For each dataset, by its name: labels of its dimensions, and whether the dataset is a scale, which has one
        dimension. A dataset may be absent from the group.
    """
    held = {name: labels for name, (labels, _) in fields.items() if isinstance(group.get(name), h5py.Dataset)}
    for name, (labels, is_scale) in fields.items():
        if not is_scale or name not in held:
            continue
        group[name].make_scale(labels[0])
        for other, theirs in held.items():
            for place, label in enumerate(theirs):
                if label == labels[0] and other != name:
                    group[other].dims[place].attach_scale(group[name])

"""Simulator of radar images: backscatter laws, acquisition geometry, speckle and image formation."""

import os

__all__ = ["SIMULATOR_VERSION", "simulator_version"]

SIMULATOR_VERSION = 3
"""Version of the built-in simulator and its geometry. It is raised whenever a change of the code changes an image."""

_CURVED_VERSION = 4  # of passes over a curved earth, which a change of the code concerned alone


def simulator_version(earth: str) -> int:
    """Version of the built-in simulator for a pass over a ``flat`` or ``curved`` earth (``radar.earth``)."""
    return SIMULATOR_VERSION if earth == "flat" else max(_CURVED_VERSION, SIMULATOR_VERSION)


# The number of threads must be set before numba is imported. In a workflow's job, Snakemake writes the number of
# threads of the rule to OMP_NUM_THREADS, which other libraries read and numba does not.
if "OMP_NUM_THREADS" in os.environ:
    os.environ.setdefault("NUMBA_NUM_THREADS", os.environ["OMP_NUM_THREADS"])

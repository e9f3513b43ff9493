"""Simulator of radar images: backscatter laws, acquisition geometry, speckle and image formation."""

import os

__all__ = ["SIMULATOR_VERSION"]

SIMULATOR_VERSION = 3
"""Version of the built-in simulator and its geometry. It is raised whenever a change of the code changes an image."""

# The number of threads must be set before numba is imported. In a workflow's job, Snakemake writes the number of
# threads of the rule to OMP_NUM_THREADS, which other libraries read and numba does not.
if "OMP_NUM_THREADS" in os.environ:
    os.environ.setdefault("NUMBA_NUM_THREADS", os.environ["OMP_NUM_THREADS"])

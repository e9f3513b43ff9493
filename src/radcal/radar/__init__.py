"""Simulator of radar images: backscatter laws, acquisition geometry, speckle and image formation."""

import os

__all__ = ["SIMULATOR_VERSION"]

SIMULATOR_VERSION = 3
"""Version of the built-in simulator and its geometry; it is raised whenever new code changes the image of a case."""

# set before numba is imported: a workflow's job has the threads of its rule, which Snakemake sets for other libraries
# in this variable
if "OMP_NUM_THREADS" in os.environ:
    os.environ.setdefault("NUMBA_NUM_THREADS", os.environ["OMP_NUM_THREADS"])

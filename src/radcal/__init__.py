"""Calibration of the backscatter laws of a SAR simulator against a measured image."""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from radcal.products.opening import Results

__all__ = ["open"]

# A workflow job ends at Ctrl-C without a traceback, because Snakemake prints the message about the interruption.
if "RADCAL_OWNER" in os.environ:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Until the job begins (radcal.session.jobs), it only imports modules, which are no garbage. A program that a job
    # starts inherits its environment, but is no script of Snakemake.
    if "snakemake.script" in sys.modules:
        gc.disable()

__version__ = "0.2.0.dev0"


def open(folder: str | Path) -> Results:  # noqa: A001 - called radcal.open
    """Results of a finished calibration: tables, and images with their units (``docs/exports.md``).

    Parameters
    ----------
    folder : path
        Results folder of a case, as ``results/dyke``.

    Raises
    ------
    StoreError
        The folder holds no finished calibration.
    """
    from radcal.products.opening import open_results

    return open_results(folder)

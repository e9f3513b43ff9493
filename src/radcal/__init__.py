"""Calibration of the backscatter laws of a SAR simulator against a measured image."""

import os
import signal

# A workflow job ends at Ctrl-C without a traceback, because Snakemake prints the message about the interruption.
if "RADCAL_OWNER" in os.environ:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

__version__ = "0.1.0"

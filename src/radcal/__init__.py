"""Calibrate the backscatter laws of a SAR simulator against a measured image."""

import os
import signal

# A job of the workflow that gets a Ctrl-C ends without a traceback: Snakemake says what is to be said.
if "RADCAL_OWNER" in os.environ:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

__version__ = "0.1.0"

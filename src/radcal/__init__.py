"""Calibrate the backscatter laws of a SAR simulator against a measured image."""

import gc
import os
import signal

# A job of the workflow that gets a Ctrl-C ends without a traceback: Snakemake says what is to be said.
if "RADCAL_OWNER" in os.environ:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # What its imports make lasts to its end: nothing of it is searched for garbage, until `radcal.running.jobs.logged`.
    gc.disable()

__version__ = "0.1.0"

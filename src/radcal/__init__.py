"""Calibrate the backscatter laws of a SAR simulator against a measured image."""

__version__ = "0.1.0"

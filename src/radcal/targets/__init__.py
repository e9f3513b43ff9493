"""Targets: what the calibration of each material must reproduce."""

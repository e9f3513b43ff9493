"""Measured image: checks against the scene, registration, and the statistics that a calibration must reproduce."""

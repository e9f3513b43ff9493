"""Measured image, read or synthetic: checks against the scene, registration, targets."""

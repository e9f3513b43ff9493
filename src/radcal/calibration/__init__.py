"""The calibration loop: design, surrogate, infill, history, stopping."""

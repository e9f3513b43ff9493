"""Calibration loop: design of experiments, surrogate, infill runs, history of the runs, and stop criteria."""

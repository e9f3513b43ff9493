"""Results of a calibration: archive, summary."""

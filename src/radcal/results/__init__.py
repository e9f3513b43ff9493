"""Results of a calibration: archive, table of runs, summary."""

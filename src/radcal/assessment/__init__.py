"""Assessment of a calibration: fit, uncertainty of the laws, and what they predict."""

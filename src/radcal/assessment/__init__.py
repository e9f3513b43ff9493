"""Assessment of a calibration: fit of the laws, their uncertainty, and their predictions of other ground."""

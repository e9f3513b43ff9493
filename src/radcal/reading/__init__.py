"""Arrays, rasters and images of others: checked before memory is taken, and brought to dB."""

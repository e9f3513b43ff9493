"""Arrays, rasters and images from files that other programs wrote: checked before they are loaded, converted to dB."""

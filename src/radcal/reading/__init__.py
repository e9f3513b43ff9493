"""Readers of files from other programs (arrays, rasters, images), with checks of the files and conversion to dB."""

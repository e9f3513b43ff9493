"""Scenes: digital twin of an area, from the built-in source, GIS rasters or labels in slant range."""

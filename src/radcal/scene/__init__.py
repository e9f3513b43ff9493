"""Scenes: digital twins of an area, from built-in terrain, GIS rasters or a label raster in slant range."""

"""Sentinel-1 products: annotation, geolocation, overpass, and the image on the scene."""

"""Scenes: the digital twin of an area, from the sources that radcal knows."""

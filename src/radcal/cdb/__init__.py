"""Scenes from OGC CDB 1.x databases."""

"""Simulators: X of every material in, image of the pass out."""

"""Simulators: protocol, built-in simulator, external programs."""

"""Simulators: common interface, built-in simulator, external programs, and runner with run store."""

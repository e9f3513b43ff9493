"""Speckle and texture: impulse response of a look, random numbers, and their statistics in dB."""

"""Simulators: X of every material in, image of the pass out."""

from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.protocol import Simulator

__all__ = ["BuiltinSimulator", "Simulator"]

"""Movers of small scenes, and the channels that detect them."""

import numpy as np

from radcal.scene.objects import Objects

GMTI = {"channels": 2, "pulses": 8, "false_alarms": 1e-5}
SPEED = 9.0


def movers(x_m, y_m, heading_deg, speed_mps, dbsm=25.0):
    """Objects without a footprint."""
    n = len(x_m)
    zero, number = np.zeros(n), np.zeros(n, dtype=np.int16)
    return Objects(
        np.array(x_m), np.array(y_m), zero, zero, np.array(heading_deg), zero + 1.5, zero + dbsm, number - 1,
        speed_mps=np.array(speed_mps),
    )  # fmt: skip

"""Simulator of the tests of runs and of their store."""

import numpy as np

X = {"dyke": [6.1, 14.2, 21.5, 3.3], "grass": [10.0, 14.0, 6.0, 4.0]}


class Counting:
    """A simulator that counts its calls; the image depends on X and the seed."""

    def __init__(self, shape, version=1):
        self.shape, self.version, self.calls = shape, version, 0

    @property
    def identity(self):
        return {"kind": "counting", "version": self.version}

    def run(self, parameters, noise_seed):
        self.calls += 1
        noise = np.random.default_rng(noise_seed).standard_normal(self.shape)
        return (noise + parameters["dyke"][0]).astype(np.float32)

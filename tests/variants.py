"""Physical wrong variants: values that a typical mistake of radar processing or statistics gives.

A test computes the right value and some wrong ones without radcal, in closed form or by scipy, from numbers that tell
them apart. Each wrong value is named after its mistake.
"""

import numpy as np

APART = 5.0  # least distance of a wrong value from the right one, in tolerances of the test


def agrees(found, right, /, *, rtol=1e-06, atol=0.0, **wrong):
    """Assert that values agree with the right ones, which are ``APART`` tolerances away from each wrong variant."""
    found, right = np.asarray(found, dtype=np.float64), np.asarray(right, dtype=np.float64)
    np.testing.assert_allclose(found, right, rtol=rtol, atol=atol)
    tolerance = atol + rtol * np.abs(right)
    assert wrong, "no wrong variant is named"
    for name, values in wrong.items():
        away = np.abs(np.asarray(values, dtype=np.float64) - right)
        assert not (away <= APART * tolerance).all(), f"the variant {name} cannot be told from the right value"

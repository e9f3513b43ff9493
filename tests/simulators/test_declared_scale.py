"""Scale of an external simulator's image: power that is declared as db, against the measured image."""

import numpy as np
import pytest

from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.errors import SimulatorError
from radcal.simulators.declared_scale import check_scale

SHAPE = (60, 50)


def declared(scale="db"):
    own = {"kind": "command", "command": ["{python}", "sim.py", "{input}"], "input": {}}
    own["output"] = {"file": "image.npy", "scale": scale}
    data = {
        "simulator": own,
        "materials": {"dyke": {"calibrate": True}},
        "measurement": {"source": "file", "path": "a.npy", "scale": "db", "radiometry": "sigma0_ref"},
        "radar": {"looks": 4},
    }
    return STAGES["reference_run"].of(case_from(data))


def image_db(level_db, seed=1):
    """Image of 4 looks whose halves differ by 5 dB, from the level given upwards."""
    level = np.where(np.arange(SHAPE[1]) < SHAPE[1] // 2, level_db, level_db + 5.0)
    return (level + 10.0 * np.log10(np.random.default_rng(seed).gamma(4.0, 0.25, SHAPE))).astype(np.float32)


MEASURED = image_db(-13.0, seed=2)


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        (10.0 ** (image_db(-14.0) / 10.0), "power"),
        (10.0 ** (image_db(-14.0) / 20.0), "amplitude"),
        (10.0 ** (image_db(9.0) / 10.0), "power"),  # the median is 14, as power of a start far too high
    ],
)
def test_power_declared_as_db_is_refused(values, scale):
    values[0, 0] = np.nan
    with pytest.raises(SimulatorError, match=r"^simulator\.output\.scale is db, but the values .* none negative") as e:
        check_scale(values.astype(np.float32), MEASURED, declared())
    said = str(e.value)
    assert f"run from {np.nanmin(values):.3g} to {np.nanmax(values):.3g} with median {np.nanmedian(values):.3g}" in said
    assert said.endswith(f"set simulator.output.scale: {scale}?")


def test_values_in_db_pass():
    check_scale(image_db(-14.0), MEASURED, declared())
    # levels of the published cases, in both images, and a start at a high level
    check_scale(image_db(54.0), image_db(54.0, seed=2), declared())
    for level in (54.0, 25.0, 16.0):
        start = image_db(level)
        assert start.min() >= 0.0
        check_scale(start, MEASURED, declared())
    # an image that is not in dB by its declaration has been converted
    check_scale(10.0 ** (MEASURED / 10.0), MEASURED, declared("power"))
    # nothing contradicts a measured image without negative values
    check_scale(10.0 ** (MEASURED / 10.0), image_db(54.0), declared())

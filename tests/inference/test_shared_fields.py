"""Two passes over the same fields, against effects that are drawn."""

import numpy as np
import pytest

from radcal.ground.bins import make_classes
from radcal.ground.ground import Ground
from radcal.ground.patches import Spread
from radcal.inference.misfit import BinMisfit, Method, together
from radcal.laws import law_for

LAW = law_for("tabulated", angles_deg=(20.0, 60.0))
METHOD = Method(LAW, [[-30.0, 10.0], [-40.0, 0.0]], looks=4.0)
X = np.array([-6.0, -16.0])
SPREAD = Spread(1.2, 0.3)


def seen(rng, low_deg, high_deg, effects, pixels=900, label=None, mixed=False):
    """Ground of one pass: fields of these effects [dB], each at its own angles, or all at all angles."""
    fields = len(effects)
    field = rng.integers(0, fields, pixels)
    place = rng.random(pixels) if mixed else (field + rng.random(pixels)) / fields
    angle = low_deg + (high_deg - low_deg) * place
    level = LAW(np.radians(angle), X) + np.asarray(effects)[field]
    values = level + 10.0 * np.log10(rng.gamma(4.0, 0.25, pixels))
    labels = np.arange(fields) if label is None else np.asarray(label)
    return Ground(values, angle, labels[field], rng.integers(0, 5, pixels))


def misfit_of(ground, bins=3):
    return BinMisfit.of(ground, make_classes(ground.values_db, ground.incidence_deg, bins), METHOD, SPREAD)


@pytest.fixture(scope="module")
def passes():
    """The second pass shows the fields 12 and 15 of the first, and one more."""
    rng = np.random.default_rng(4)
    first = seen(rng, 25.0, 40.0, [0.0, 0.0, 0.0], label=[15, 12, 40])
    second = seen(rng, 38.0, 55.0, [0.0, 0.0, 0.0], 700, label=[12, 7, 15])
    return [misfit_of(first), misfit_of(second, 2)]


def test_the_covariance_of_the_means_is_that_of_effects_that_are_drawn(passes):
    joined = together(passes)
    n = joined.classes.size
    assert n == 5
    rng = np.random.default_rng(8)
    effect = dict(zip([7, 12, 15, 40], SPREAD.between * rng.normal(size=(4, 40_000)), strict=True))
    drawn = []
    for one in passes:
        fields = np.stack([effect[label] for label in one.patches])
        cells = fields[one.patch_of_cell] + SPREAD.within * rng.normal(size=(len(one.patch_of_cell), 40_000))
        noise = np.sqrt(np.diag(one.sampling)[: one.classes.size])[:, None]
        drawn.append(one.cell_share @ cells + noise * rng.normal(size=(one.classes.size, 40_000)))
    wanted = np.cov(np.concatenate(drawn))
    sd = np.sqrt(np.diag(wanted))
    np.testing.assert_allclose(joined.covariance[:n, :n] / np.outer(sd, sd), wanted / np.outer(sd, sd), atol=0.02)
    assert np.abs(wanted[:3, 3:] / np.outer(sd[:3], sd[3:])).max() > 0.4
    # each pass keeps what it has by itself
    for one, at in zip(passes, (np.arange(3), np.arange(3, 5)), strict=True):
        of_all = np.concatenate([at, at + n, at + 2 * n])
        np.testing.assert_allclose(joined.covariance[np.ix_(of_all, of_all)], one.covariance, rtol=1e-12)

"""Posteriors and images in files, intervals in which sigma0 is determined, and curves of kept draws."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, NOTHING_SHOWN, held_cells, made_image, made_posterior

from radcal.errors import StoreError
from radcal.posterior.curves import GRID_DEG
from radcal.posterior.result import Constant, Image, KeptDraws, Posterior, known_between
from radcal.storage.dataclass_groups import same

ANGLES = np.arange(0.0, 85.25, 0.25)


def between(half_db, *seen, known_db=1.5):
    return known_between(ANGLES, np.broadcast_to(half_db, ANGLES.shape), seen, known_db)


def test_determined_is_the_incidence_seen_where_the_band_is_narrow():
    assert between(1.4, (20.1, 31.6)) == (20.25, 31.5)
    # a half-width of exactly the limit is narrow enough
    assert between(1.5, (20.0, 31.5)) == (20.0, 31.5)
    assert between(1.6, (20.1, 31.6)) is None
    # from 0.1 dB per degree on: 1.5 dB at 15 degrees
    assert between(0.1 * ANGLES, (10.0, 40.0)) == (10.0, 15.0)
    assert between(0.1 * ANGLES, (10.0, 40.0), known_db=2.2) == (10.0, 22.0)


def test_the_largest_of_several_intervals_is_determined():
    half = np.where((ANGLES > 24.0) & (ANGLES < 26.0), 3.0, 1.0)
    assert between(half, (20.0, 36.0)) == (26.0, 36.0)
    # passes at other angles, and at overlapping ones
    assert between(1.0, (20.0, 24.0), (50.0, 60.0)) == (50.0, 60.0)
    assert between(1.0, (20.0, 30.0), (28.0, 37.0)) == (20.0, 37.0)
    # one angle is no interval
    assert between(1.0, (20.1, 20.3)) is None


def kept(n=5):
    rng = np.random.default_rng(2)
    return KeptDraws(
        LINE_X + rng.normal(0.0, 1.0, (n, 2)), rng.uniform(0.2, 1.0, n), rng.uniform(0.1, 0.5, n),
        rng.normal(0.0, 0.3, (n, 91)), rng.normal(0.0, 0.6, n),
    )  # fmt: skip


def test_curves_are_mean_power_of_fields_and_cells():
    """An effect of a standard deviation s in dB raises the mean power by (ln 10 / 20) s^2, to first order."""
    draws = kept()
    for k, angle in ((0, 20.0), (2, 33.0), (4, 57.0)):
        law = float(LINE(np.radians(angle), draws.parameters[k])) + draws.form_db[k, int(angle)]
        at = int(4 * angle)
        raised = {
            sd: 10.0 * np.log10(np.mean(10.0 ** (sd * np.random.default_rng(1).normal(size=400_000) / 10.0)))
            for sd in (draws.field_db[k], draws.cell_db[k])
        }
        assert draws.laws_db(LINE)[k, at] == pytest.approx(law)
        assert draws.curves_db(LINE)[k, at] == pytest.approx(law + sum(raised.values()), abs=0.01)
        of_fields = law + draws.fields_db[k] + raised[draws.cell_db[k]]
        assert draws.field_curves_db(LINE)[k, at] == pytest.approx(of_fields, abs=0.01)
    # between whole degrees, the error of the form is a straight line
    half = draws.laws_db(LINE)[:, 4 * 30 + 2] - [float(LINE(np.radians(30.5), x)) for x in draws.parameters]
    np.testing.assert_allclose(half, draws.form_db[:, 30:32].mean(axis=1))
    assert draws.curves_db(LINE).shape == (5, GRID_DEG.size)


def test_files(tmp_path):
    whole = made_posterior(
        draws=kept(), constant=Constant(-9.0, 0.02, 0.6, 0.3), held=held_cells(), left_out=held_cells()
    )
    bare = replace(whole, curve=None, known_between_deg=None, known_half_width_db=None, form=None, draws=None)
    for one in (whole, bare):
        one.write(tmp_path / "posterior.h5")
        assert same(Posterior.read(tmp_path / "posterior.h5"), one)
    nothing = made_image(laws_db={}, apart_db={}, radiometry={"1": NOTHING_SHOWN})
    for one in (made_image(), nothing):
        one.write(tmp_path / "image.h5")
        read = Image.read(tmp_path / "image.h5")
        assert list(read.laws_db) == list(one.laws_db)
        np.testing.assert_array_equal(read.levels_db, one.levels_db)
        assert read.radiometry["1"].materials == one.radiometry["1"].materials
        assert read.radiometry["1"].checked is one.radiometry["1"].checked
    with pytest.raises(StoreError):
        Posterior.read(tmp_path / "image.h5")

"""Posteriors as ArviZ reads them: groups, dimensions, and a netCDF file."""

import numpy as np
import pytest
from archives import changed_material, posterior, without_curve

from radcal.errors import StoreError
from radcal.posterior.result import KeptDraws, LevelPoints
from radcal.products.posterior_tree import posterior_tree

RNG = np.random.default_rng(3)
LEVELS, ERRORS = np.array([-9.0, -10.5, -11.0]), np.array([0.4, 0.3, 0.2])
POINTS = LevelPoints(np.array([25.5, 31.0, 33.5]), LEVELS, ERRORS, LEVELS[:, None] + np.zeros(3), 0.5)


def draws(count):
    x, sd = RNG.normal([1.0, 2.0, 3.0, 4.0], 0.3, (count, 4)), RNG.uniform(0.2, 0.9, (2, count))
    return KeptDraws(x, *sd, RNG.normal(0.0, 0.1, (count, 91)), np.zeros(count))


@pytest.fixture(scope="module")
def archive(made):
    """The dyke with 400 draws, levels and a prior, stem beans with fewer draws and no curve."""
    prior = RNG.uniform(0.0, 50.0, (2000, 4))
    found = changed_material(made.archive, "dyke", posterior=posterior(draws=draws(400), points=POINTS), prior=prior)
    return changed_material(found, "stem beans", posterior=without_curve(draws=draws(250), r_hat=1.08))


def test_draws_have_the_dimensions_of_arviz_and_materials_their_own_numbers(archive):
    tree = posterior_tree(archive)
    assert set(tree.children) == {"posterior", "prior", "sample_stats", "observed_data"}
    found, own = tree["posterior"].dataset, archive.materials["dyke"].posterior.draws
    assert found["X2"].dims == ("chain", "draw", "material")
    np.testing.assert_array_equal(found["X2"].sel(material="dyke")[0], own.parameters[:, 1])
    beans = archive.materials["stem beans"].posterior.draws
    np.testing.assert_array_equal(found["cell_db"].sel(material="stem beans", draw=slice(0, 249))[0], beans.cell_db)
    assert found["X2"].sel(material="stem beans", draw=slice(250, None)).isnull().all()
    # mean power: the law, its form error, and half of ln 10 / 10 of the variance of fields and cells
    law, angle = archive.configured.laws["dyke"], np.radians(35.0)
    each = np.array([law(angle, x) for x in own.parameters]) + own.form_db[:, 35]
    wanted = each + np.log(10.0) / 20.0 * (own.field_db**2 + own.cell_db**2)
    np.testing.assert_allclose(found["sigma0_db"].sel(material="dyke", incidence_deg=35.0)[0], wanted)
    assert found["sigma0_db"].sel(material="stem beans").isnull().all()
    assert tree["prior"].dataset.sizes == {"chain": 1, "draw": 2000, "material": 2}
    np.testing.assert_array_equal(tree["sample_stats"].dataset["r_hat"], [1.01, 1.08])
    np.testing.assert_array_equal(tree["observed_data"].dataset["level_db"], [POINTS.level_db])


def test_arviz_reads_the_file(archive, tmp_path):
    arviz = pytest.importorskip("arviz", reason="arviz is missing: pip install 'radcal[arviz]' 'arviz<1'")
    posterior_tree(archive).to_netcdf(tmp_path / "posterior.nc", engine="h5netcdf")
    found = arviz.from_netcdf(tmp_path / "posterior.nc")
    assert set(found.groups()) == {"posterior", "prior", "sample_stats", "observed_data"}
    own = archive.materials["dyke"].posterior.draws.parameters
    table = arviz.summary(found.sel(material=["dyke"]), var_names=["X1", "X4"], kind="stats", round_to="none")
    assert list(table.index) == ["X1[dyke]", "X4[dyke]"]
    np.testing.assert_allclose(table["mean"], own[:, [0, 3]].mean(axis=0))
    np.testing.assert_allclose(table["sd"], own[:, [0, 3]].std(axis=0, ddof=1), rtol=0.01)


def test_an_archive_without_draws_is_refused(made):
    with pytest.raises(StoreError, match="small: no posterior has draws, expected those of a calibrated material"):
        posterior_tree(made.archive)

"""Files and findings of the product ``ppi``."""

from dataclasses import replace

import numpy as np
import pytest
import xradar

from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.ppi.product import check, write
from radcal.simulators.forward import Forward

PPI = {"range_m": 96.0, "gate_m": 3.0, "pulses": 50, "mast_m": 20.0}


@pytest.fixture
def made(build_case, scene, geometry):
    case = build_case(ppi=PPI)
    return Forward(case, scene, geometry, np.zeros((1, 1), np.float32), "key", 1, False, lambda: iter(()))


def test_xradar_opens_the_file(made, tmp_path):
    paths = [one for one in write(tmp_path / "ppi", made) if not isinstance(one, Finding)]
    assert [path.name for path in paths] == ["ppi.h5", "ppi.png"]
    again = write(tmp_path / "again", made)
    assert (tmp_path / "ppi.png").read_bytes() == again[1].read_bytes()
    tree = xradar.io.open_cfradial2_datatree(paths[0], engine="h5netcdf")
    sweep = tree["sweep_0"].to_dataset()
    assert sweep["SNR"].dims == ("time", "range")
    assert sweep["SNR"].shape == (100, 32)
    np.testing.assert_allclose(sweep["range"], 1.5 + 3.0 * np.arange(32))
    np.testing.assert_allclose(sweep["azimuth"], 49 * 0.036 + 3.6 * np.arange(100))
    seconds = (sweep["time"] - sweep["time"][0]) / np.timedelta64(1, "s")
    assert seconds[-1] == pytest.approx(2.5 * 0.99)  # 24 turns in a minute
    assert float(sweep["SNR"].mean()) > 20.0
    x, y = 20, 20
    assert float(tree["altitude"]) == pytest.approx(made.scene.elevation_m[y, x] + 20.0)


def test_findings_name_extrapolated_laws_and_alarms(made, tmp_path):
    found = [one for one in write(tmp_path / "ppi", made) if isinstance(one, Finding)]
    assert [(one.code, one.about) for one in found] == [
        ("ppi_extrapolated", "dyke"),
        ("ppi_extrapolated", "grass"),
        ("ppi_detections", "ppi"),
    ]
    assert found[0].numbers["median_deg"] > 65.0 > found[0].numbers["high_deg"] > 45.0
    assert found[-1].numbers["objects"] == 0.0
    assert 0.0 < found[-1].numbers["alarms"] < 0.5
    rural = replace(
        made, case=made.case.model_copy(update={"ppi": made.case.ppi.model_copy(update={"land": {"dyke": "rural"}})})
    )
    found = [one for one in write(tmp_path / "ppi", rural) if isinstance(one, Finding)]
    assert [one.about for one in found] == ["grass", "ppi"]


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"site_m": [300.0, 10.0]}, "ppi.site_m is [300.0, 10.0], expected a place in the scene of 200 x 200 m"),
        ({"land": {"gras": "rural"}}, "ppi.land.gras: no such material (did you mean 'grass'?)"),
        ({"gate_m": 0.001}, "a turn would have 480,000,000 pulses and gates"),
    ],
)
def test_contradictions_with_the_scene(build_case, scene, keys, says):
    with pytest.raises(ConfigError) as caught:
        check(build_case(ppi=PPI | keys), scene)
    assert says in str(caught.value)


def test_a_scene_without_heights_or_band(build_case, scene):
    with pytest.raises(ConfigError, match=r"scene\.source is builtin, whose scene has no heights"):
        check(build_case(ppi=PPI), replace(scene, elevation_m=None))
    with pytest.raises(ConfigError, match=r"radar\.band is 'Q', which names no known band, expected radar\.freq"):
        check(build_case(ppi=PPI, radar={"band": "Q"}), scene)

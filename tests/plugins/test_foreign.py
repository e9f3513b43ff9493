"""Variants of another distribution in a case file, through the stages that use them."""

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from registration_samples import displaced, ground, smooth_field, speckled

from radcal import plugins
from radcal.config import case_from, input_files, load
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, MeasurementError
from radcal.image.model import Measurement
from radcal.measurement.sources import make_measurement
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.scene.base import scene_size
from radcal.scene.sources import make_scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner, make_simulator
from radcal.storage.files import digest
from radcal.storage.runs import RunStore
from radcal.words import sentence

CASE = """
case: foreign
scene: {source: elsewhere_ramp, side: 40, slope: 0.2}
radar: {altitude_m: 1000, radiometry: sigma0_local, looks: 4}
materials:
  dyke: {calibrate: true, law: elsewhere_line}
  grass: {parameters: [-14, 6, 2, 4]}
measurement: {source: file, path: image.sar, scale: power}
registration: {method: elsewhere_half}
target: {pixels: 200}
"""


@pytest.fixture
def installed(install, tmp_path, monkeypatch):
    """Folder with the distribution, as an installer leaves it, and the case."""
    package = Path(__file__).parent / "foreign"
    project = tomllib.loads((package / "pyproject.toml").read_text())["project"]
    install("elsewhere-sar", **project["entry-points"])
    shutil.copy(package / "elsewhere_sar.py", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def loaded(folder, **changes):
    text = CASE
    for old, new in changes.items():
        text = text.replace(old, new)
    (folder / "case.yaml").write_text(text)
    return load(["case.yaml"])


def test_scene_law_and_reader_of_another_package_make_a_measurement(installed):
    case = loaded(installed)
    assert scene_size(case.scene).cells == 1600
    # a job restores its stage from plain data
    stage = STAGES["measurement"].model.model_validate(STAGES["measurement"].params(case))
    again = STAGES["scene"].model.model_validate(STAGES["scene"].params(case)).scene
    assert again == case.scene
    scene = make_scene(again, list(case.materials))
    geometry = make_geometry(scene, case.radar)
    parameters = {"dyke": [-8.0, -6.0], "grass": [-14.0, 6.0, 2.0, 4.0]}
    image = BuiltinSimulator(geometry, case.radar, case.laws).run(parameters, 3)
    power = np.nan_to_num(10.0 ** (image / 10.0))
    np.savetxt("image.sar", power, header=f"{case.radar.polarisation} sigma0_local", comments="")
    assert input_files(case)["measurement.path"] == Path("image.sar")
    nothing = None
    found = make_measurement(stage, geometry, nothing, scene)
    np.testing.assert_allclose(found.image_db, np.where(power > 0, image, np.nan), atol=1e-4)
    assert "image.sar: levels of a table." in map(sentence, found.findings)
    np.savetxt("image.sar", power, header=f"{case.radar.polarisation} gamma0", comments="")
    with pytest.raises(MeasurementError, match=r"the radiometry of image\.sar is gamma0, radar\.radiometry is sigma0_"):
        make_measurement(stage, geometry, nothing, scene)


def of_version(folder, version):
    metadata = folder / "elsewhere-sar-1.5.dist-info/METADATA"
    metadata.write_text(metadata.read_text().replace("1.5", version))
    plugins._installed.cache_clear()


def test_another_version_gives_another_scene_and_law(installed):
    case = loaded(installed)
    one = make_scene(case.scene, None).identity
    assert case.laws["dyke"].description == {"law": "elsewhere_line", "distribution": "elsewhere-sar", "version": "1.5"}
    of_version(installed, "1.6")
    assert loaded(installed).laws["dyke"].description["version"] == "1.6"
    assert make_scene(case.scene, None).identity != one


def test_a_run_by_a_foreign_simulator_and_a_law_with_a_condition(installed, geometry):
    def runner(permittivity):
        law = {"law": "elsewhere_damp", "conditions": {"permittivity": permittivity}}
        case = case_from(
            {
                "simulator": {"kind": "elsewhere_level", "gain_db": 2.0},
                "materials": {
                    "dyke": {**law, "calibrate": True, "bounds": [[-30, -10]]},
                    "grass": {"law": "constant_gamma", "parameters": [-10]},
                },
                "measurement": {"synthetic": {"parameters": {"dyke": [-15]}}},
            }
        )
        stage = STAGES["reference_run"].model.model_validate(STAGES["reference_run"].params(case))  # as in a job
        return Runner(RunStore(installed), make_simulator(stage, geometry, installed), geometry, "scene", stage)

    x = {"dyke": [-20.0], "grass": [-10.0]}
    image = runner(5.0).run(x, 1, image=True).image_db
    np.testing.assert_allclose(image.ravel()[geometry.pixels("dyke")], -20.0 + 5.0 + 2.0, atol=1e-5)
    described = runner(5.0).description(x, 1)
    origin = {"distribution": "elsewhere-sar", "version": "1.5"}
    assert described["simulator"] == {"kind": "elsewhere_level", "gain_db": 2.0, **origin}
    law = {"law": "elsewhere_damp", "conditions": {"permittivity": 5.0}, "parameters": [-20.0]}
    assert described["materials"]["dyke"] == {**law, **origin}
    keys = {digest(described), digest(runner(6.0).description(x, 1))}
    of_version(installed, "1.6")  # a new version does not take the runs of an earlier one
    assert len(keys | {digest(runner(5.0).description(x, 1))}) == 3
    with pytest.raises(ConfigError, match=r"complex is not one of simulator\.kind: elsewhere_level"):
        runner(5.0).require_looks("complex")


def test_mistakes_in_the_keys_of_another_package_are_named(installed):
    with pytest.raises(ConfigError, match=r"scene\.side is 5, expected greater than or equal to 20"):
        loaded(installed, **{"side: 40": "side: 5"})
    with pytest.raises(ConfigError, match=r"scene\.source is 'elsewhere_rmp', expected .*'cdb', 'elsewhere_ramp'"):
        loaded(installed, elsewhere_ramp="elsewhere_rmp")
    with pytest.raises(ConfigError, match=r"simulator\.gain_db is 'x', expected a number"):
        case_from({"simulator": {"kind": "elsewhere_level", "gain_db": "x"}})
    with pytest.raises(ConfigError, match=r"registration\.method is 'half', expected 'gefolki', 'ilk', 'elsewhere_h"):
        loaded(installed, elsewhere_half="half")


def test_a_method_of_another_package_registers(installed):
    case = loaded(installed)
    mean = ground((128, 128), 1)
    image = speckled(displaced(mean, smooth_field((128, 128), 2, 4.0, 30.0)), 3)
    whole, half = (
        register(speckled(mean, 4), Measurement(image, "a"), case.registration.model_copy(update={"method": method}))
        for method in ("gefolki", "elsewhere_half")
    )
    assert (half.method, half.applied) == ("elsewhere_half", True)
    np.testing.assert_allclose(half.displacement_px, 0.5 * whole.displacement_px, atol=1e-6)

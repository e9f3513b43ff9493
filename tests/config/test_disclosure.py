import hashlib
import pickle

from config_samples import COMMAND

from radcal.config import case_from
from radcal.config.disclosure import Undisclosed, disclosed
from radcal.config.stages import STAGES

SECRET = "s3cr3t"
HASH = hashlib.sha256(SECRET.encode()).hexdigest()


def test_values_are_hashed_wherever_a_simulator_stands():
    identity = {"kind": "command", "environment": {"KEY": SECRET, "B": "2"}}
    for data in (identity, {"simulator": identity, "seed": 1}):
        copy = disclosed(data)
        found = copy.get("simulator", copy)
        assert found["environment_sha256"]["KEY"] == HASH
        assert found["environment_sha256"]["B"] != "2"
        assert "environment" not in found
        assert disclosed(copy) == copy
    assert identity["environment"]["KEY"] == SECRET
    # without variables, and for other simulators, files stay what they were
    for plain in ({"kind": "command", "environment": {}}, {"simulator": {"kind": "builtin"}}, {"seed": 2}):
        assert disclosed(plain) == plain


def test_sections_carry_the_values_and_do_not_print_them():
    simulator = {**COMMAND, "environment": {"KEY": SECRET}}
    sections = STAGES["reuse"].params(case_from({"simulator": simulator}))
    assert HASH in repr(sections)
    assert SECRET not in repr(sections)
    again = pickle.loads(pickle.dumps(sections))
    assert STAGES["reuse"].model.model_validate(again).simulator.environment == {"KEY": SECRET}
    assert isinstance(again["simulator"]["environment"], Undisclosed)
    without = STAGES["reuse"].params(case_from({"simulator": simulator | {"environment": {}}}))
    assert "'environment': {}" in repr(without)

"""Variants by name: radcal's own first, those of other distributions by their entry points."""

import pytest

from radcal import plugins
from radcal.errors import ConfigError
from radcal.plugins import Plugins

OWN = Plugins("radcal.laws", {"at_once": 2, "late": "math:tau"})


def test_own_variants_come_without_a_look_at_installed_distributions(monkeypatch):
    monkeypatch.setattr(plugins, "_entry_points", lambda group: pytest.fail("metadata are read"))
    assert (OWN["at_once"], "late" in OWN, OWN.origin("late")) == (2, True, {})
    assert OWN["late"] == pytest.approx(6.2831853)


def test_a_foreign_variant_has_distribution_and_version(install):
    points = {"theirs": "math:e", "broken": "no_such_module:x", "part": "radcal.image.base:Reader"}
    install("elsewhere", **{"radcal.laws": points})
    assert list(OWN) == ["at_once", "late", "theirs", "broken", "part"]
    assert len(OWN) == 5
    assert OWN["theirs"] == pytest.approx(2.7182818)
    assert OWN.origin("theirs") == {"distribution": "elsewhere", "version": "1.5"}
    assert ("broken" in OWN, "unknown" in OWN, OWN.get("unknown")) == (True, False, None)
    with pytest.raises(ConfigError, match=r"'broken' of elsewhere 1\.5 .* no_such_module:x: ModuleNotFoundError"):
        _ = OWN["broken"]
    with pytest.raises(ConfigError, match=r"'part' of elsewhere 1\.5 lacks matches, read, expected"):
        _ = OWN["part"]


@pytest.mark.parametrize(("name", "owner"), [("late", "radcal"), ("theirs", "elsewhere")])
def test_a_name_of_two_distributions_is_refused(install, name, owner):
    install("elsewhere", **{"radcal.laws": {"theirs": "math:e"}})
    install("other", **{"radcal.laws": {name: "math:pi"}})
    with pytest.raises(ConfigError, match=rf"{owner} and other 1\.5 both have '{name}'|other and {owner} 1\.5 both"):
        list(OWN)

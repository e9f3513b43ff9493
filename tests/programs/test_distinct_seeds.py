"""The seeds of an external program tell its runs apart."""

import pytest

from radcal.config import case_from
from radcal.errors import ConfigError
from radcal.programs.command_plan import check_command
from radcal.seeds import derived_seed, draw_seeds, measurement_seed, noise_seed

MATERIALS = {"dyke": {"calibrate": True, "law": "external", "names": ["a", "n"], "bounds": [[0, 9], [0, 9]]}}


def case_of(words, sections=None, **simulator):
    return case_from(
        {
            "case": "mine",
            "materials": MATERIALS,
            "measurement": {"source": "file", "path": "m.tif", "scale": "db", "radiometry": "sigma0_ref"},
            "simulator": {
                "kind": "command",
                "command": ["sh", "{dyke.a}", "{dyke.n}", *words],
                "output": {"file": "i.npy", "scale": "db"},
                **simulator,
            },
            **(sections or {}),
        }
    )


def test_a_program_has_seeds_that_a_c_int_holds():
    case = case_of(["{noise_seed}"])
    seeds = [noise_seed(case), noise_seed(case, fresh=True), measurement_seed(case.simulator, 2)]
    assert len({seed for seed in seeds if 0 < seed < 2**31}) == 3
    assert noise_seed(case_of(["{noise_seed}"], seed_bits=63)) == derived_seed(1, "runs", "common")
    assert noise_seed(case_from({})) == derived_seed(1, "runs", "common")  # radcal's own has 63


@pytest.mark.parametrize("seed", range(1, 6))
def test_speckle_draws_have_seeds_of_their_own_also_of_8_bits(seed):
    """64 of 255 seeds: with independent ones, nearly every case would have two that are equal."""
    case = case_of(["{noise_seed}"], {"seed": seed}, seed_bits=8, draws=64)
    seeds = [*draw_seeds(case), noise_seed(case, fresh=True)]
    assert len(set(seeds)) == len(seeds) == 65
    assert seeds[0] == noise_seed(case)
    wide = case_of(["{noise_seed}"], {"seed": seed}, seed_bits=63, draws=3)
    assert draw_seeds(wide)[1:] == [derived_seed(seed, "runs", "draw", k) for k in (2, 3)]


def test_a_program_without_seed_has_no_further_draws():
    with pytest.raises(ConfigError, match=r"simulator: draws is 4, expected 1 with seedless: true"):
        case_of([], seedless=True, draws=4)


def test_a_program_without_its_seed_is_refused_unless_it_takes_none():
    with pytest.raises(ConfigError, match=r"^simulator: noise_seed never reaches the program, .*seedless: true\.$"):
        check_command(case_of([]))
    check_command(case_of([], seedless=True))
    check_command(case_of(["{noise_seed}"]))
    check_command(case_of([], input={}))


def test_seeds_that_a_range_makes_equal_are_refused(tmp_path):
    def found(seed, word):
        case = case_of([], {"seed": seed})
        low, high = map(int, word.split(".."))
        return [low + noise_seed(case, fresh) % (high - low + 1) for fresh in (False, True)]

    alike = next(seed for seed in range(100) if len(set(found(seed, "5..7"))) == 1)
    apart = next(seed for seed in range(100) if len(set(found(seed, "5..7"))) == 2)
    check_command(case_of(["{noise_seed:5..7}"], {"seed": apart}))
    number = found(alike, "5..7")[0]
    with pytest.raises(
        ConfigError,
        match=rf"^simulator\.command\.3: noise_seed is {number} for the runs of the calibration as for the final run "
        rf"with fresh random numbers: change seed \(it is {alike}\), or widen the range\.$",
    ):
        check_command(case_of(["{noise_seed:5..7}"], {"seed": alike}))
    # another place tells them apart
    check_command(case_of(["{noise_seed:5..7}", "{noise_seed}"], {"seed": alike}))
    synthetic = {"source": "synthetic", "synthetic": {"parameters": {"dyke": [1, 2]}}}
    with pytest.raises(ConfigError, match="the synthetic measurement"):
        check_command(case_of(["{noise_seed:5..6}"], {"seed": apart, "measurement": synthetic}))

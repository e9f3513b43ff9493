import hashlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radcal.seeds import derived_rng, derived_seed


def test_derived_seeds_are_the_same_in_every_session():
    # a change of this number would silently change every stored run's key
    assert derived_seed(1, "a", 2) == derived_seed(1, "a", "2")
    assert derived_seed(1) == 0x6B86B273FF34FCE1 >> 1  # the start of sha256("1")


def test_different_names_and_seeds_give_different_streams():
    uses = [(1,), (2,), (1, "a"), (1, "b"), (1, "a", 0), (1, "a", 1), (11, "a"), (1, "1", "a"), (1, "ab")]
    assert len({derived_seed(*use) for use in uses}) == len(uses)
    a, b = (derived_rng(1, name).standard_normal(10_000) for name in ("a", "b"))
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.04


@pytest.mark.parametrize("name", ["", "Röhricht", "小麦 2", "a/b\n"])
def test_seeds_of_any_name_are_hashes_of_its_utf_8(name):
    for seed in (0, 3, 2**63 - 1):
        wanted = int(hashlib.sha256(f"{seed}/{name}".encode()).hexdigest()[:16], 16) // 2
        assert derived_seed(seed, name) == wanted


@given(seed=st.integers(0, 2**63 - 1), bits=st.integers(8, 63))
def test_narrow_seeds_are_the_leading_bits_and_never_zero(seed, bits):
    wide, narrow = derived_seed(seed, "x"), derived_seed(seed, "x", bits=bits)
    assert 1 <= narrow < 2**bits
    assert narrow == max(wide >> (63 - bits), 1)


def test_zero_is_no_seed():
    # leading bits that are all zero: many programs take that for "from the clock"
    zeros = [seed for seed in range(2000) if derived_seed(seed, "x") >> 55 == 0]
    assert zeros
    assert all(derived_seed(seed, "x", bits=8) == 1 for seed in zeros)

"""Words for the reasons of an end."""

from typing import get_args

import pytest

from radcal.calibration.stopping import Decision, Reason
from radcal.results.reasons import REASONS


def test_every_reason_of_an_end_has_words():
    assert set(REASONS) == {*get_args(Reason), "running"}
    for name in ("clause", "cell", "label"):
        assert len({getattr(words, name) for words in REASONS.values()}) == len(REASONS)


@pytest.mark.parametrize("reason", get_args(Reason))
def test_the_words_and_the_decision_agree_on_what_is_met(reason):
    assert REASONS[reason].met == Decision({}, reason).converged

import pytest

from radcal.bands import letter_band, same_label, within_band


@pytest.mark.parametrize(
    ("instrument", "frequency_hz", "letter"),
    [
        ("TerraSAR-X", 9.65e9, "X"),
        ("Sentinel-1", 5.405e9, "C"),
        ("NovaSAR", 3.2e9, "S"),
        ("ALOS-2", 1.2575e9, "L"),
        ("BIOMASS", 435e6, "UHF"),
        ("CARABAS", 50e6, "VHF"),
        ("MiniSAR", 16.8e9, "Ku"),
        ("automotive", 77e9, "W"),
        ("MIRANDA", 35e9, "Ka"),
        ("edges belong to the upper band", 8e9, "X"),
        ("below", 20e6, None),
        ("above", 300e9, None),
        ("unknown", float("nan"), None),
    ],
)
def test_letters_of_known_instruments(instrument, frequency_hz, letter):
    assert letter_band(frequency_hz) == letter


def test_labels():
    for label in ("X", "x", "X-band", "X band", " x_BAND", "Xband"):
        assert same_label(label, "X")
        assert within_band(label, 9.65e9)
        assert within_band(label, 5.4e9) is False
    assert not same_label("K", "Ka")
    assert not same_label("band", "X")


def test_p_is_a_part_of_uhf():
    assert within_band("P", 435e6)
    assert within_band("UHF", 435e6)
    assert within_band("P", 900e6) is False


@pytest.mark.parametrize("label", ["", "9.6 GHz", "third", "XX"])
def test_labels_that_are_no_letters(label):
    assert within_band(label, 9.6e9) is None

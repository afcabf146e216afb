"""The reference landings, with whatever build of the library is loaded; `make golden` compares all builds."""

import golden


def test_reference_landings_have_their_bits():
    assert golden.report(threads=2) == golden.REFERENCE.read_text(encoding="ascii")


def test_reference_landings_cover_every_start_and_more_than_one_outcome():
    starts = {case[8] for case in golden.CASES.values()}
    assert starts == {"imparted", "flown", "at_trigger"}
    text = golden.REFERENCE.read_text(encoding="ascii")
    assert "legs 4" in text
    assert "legs 0" in text
    assert "body 1" in text
    assert "end missed" in text

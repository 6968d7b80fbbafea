"""What is stable beats what is not, and a small lead is a tie."""

from scenarios.thesis.findings_chapter_4 import Flexibility

FITS = {"ARMAX": 97.60, "OE": 97.55, "ARX": 96.9, "IV4": 97.61}


def test_a_small_lead_is_a_tie_and_wins_nothing() -> None:
    found = Flexibility(FITS, (), 6)
    assert not found.best("ARMAX", "OE")
    assert not found.best("OE", "ARMAX")
    assert "ARMAX and OE are tied on the 6 tests not seen: +0.05 points, less than 0.2" in found.words("ARMAX", "OE")
    ahead = Flexibility({**FITS, "OE": 97.2}, (), 6)
    assert ahead.best("ARMAX", "OE")
    assert not ahead.best("OE", "ARMAX")
    assert "ARMAX follows the 6 tests not seen 0.40 points better than OE" in ahead.words("ARMAX", "OE")
    assert "OE follows the 6 tests not seen 0.40 points worse than ARMAX" in ahead.words("OE", "ARMAX")


def test_a_dismissed_method_above_the_best_is_told() -> None:
    said = Flexibility(FITS, (), 6).words("ARMAX", "OE")
    assert "IV4 by 0.010 points (tied)" in said
    assert "ARX by" not in said
    assert "dismissed" not in Flexibility({**FITS, "IV4": 90.0}, (), 6).words("ARMAX", "OE")


def test_an_unstable_model_is_worse_than_any_stable_one() -> None:
    stable = {name: fit for name, fit in FITS.items() if name != "ARMAX"}
    found = Flexibility(stable, ("ARMAX",), 6)
    assert found.best("OE", "ARMAX")
    assert not found.best("ARMAX", "OE")
    assert "the ARMAX model from the estimation test is unstable" in found.words("ARMAX", "OE")
    neither = Flexibility({}, ("ARMAX", "OE"), 6)
    assert not neither.best("OE", "ARMAX")
    assert not neither.best("ARMAX", "OE")
    assert "the ARMAX model and the OE model" in neither.words("ARMAX", "OE")

"""Numbers as text."""

import numpy as np

from scenarios.thesis.finding import decided
from scenarios.thesis.wording import measure, number, plain, root


def test_numbers_have_four_digits_and_counts_none() -> None:
    assert number(0.98765) == "0.9877"
    assert number(7.0) == "7"
    assert number(-2.5) == "−2.500"
    assert number(1234.5) == "1234"
    assert number(np.nan) == "–"


def test_a_probability_too_small_to_compute_is_said_to_be_so() -> None:
    finding = decided("F9", "partly", 0.0, "p-value of the whiteness", "so")
    assert measure(0.0, finding).startswith("< 1e")
    assert measure(0.0, decided("F9", "partly", 0.0, "percent", "so")) == "0"


def test_roots() -> None:
    assert root(-0.5 + 0j) == "−0.500"
    assert root(0.5 - 0.25j) == "0.500 − 0.250j"


def test_parameters() -> None:
    assert plain((0.2, 0.17)) == "0.2 × 0.17"
    assert plain(0.0261799387) == "0.02618"
    assert plain("none") == "none"

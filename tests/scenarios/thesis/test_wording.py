"""Numbers as text."""

import numpy as np

from scenarios.thesis.finding import decided_finding
from scenarios.thesis.tally import limits, measure, number, parts, root, spread, value_text


def test_numbers_have_four_digits_and_counts_none() -> None:
    assert number(0.98765) == "0.9877"
    assert number(7.0) == "7"
    assert number(-2.5) == "−2.500"
    assert number(1234.5) == "1234"
    assert number(np.nan) == "–"


def test_a_probability_too_small_to_compute_is_said_to_be_so() -> None:
    finding = decided_finding("F9", "partly", 0.0, "p-value of the whiteness", "so")
    assert measure(0.0, finding).startswith("< 1e")
    assert measure(0.0, decided_finding("F9", "partly", 0.0, "percent", "so")) == "0"


def test_roots() -> None:
    assert root(-0.5 + 0j) == "−0.500"
    assert root(0.5 - 0.25j) == "0.500 − 0.250j"


def test_parameters() -> None:
    assert value_text((0.2, 0.17)) == "0.2 × 0.17"
    assert value_text(0.0261799387) == "0.02618"
    assert value_text("none") == "none"


def test_counts_are_shown_with_their_whole() -> None:
    value = {"shoulder_yaw": 0.9, "unstable": 1.0, "of": 8.0, "others": 2.0, "of as many as": 48.0}
    assert parts(decided_finding("F13", "partly", value, "", "so")) == [
        ("shoulder_yaw", "0.9000", None),
        ("unstable", "1", "8"),
        ("others", "2", "48"),
    ]
    assert parts(decided_finding("F13", "partly", 2.5, "", "so")) == [("", "2.500", None)]
    assert parts(decided_finding("F13", "cannot be told", {}, "", "so")) == []


def test_ranges_are_counts_for_counts_and_shares_for_two_values() -> None:
    finding = decided_finding("F13", "partly", 1.0, "", "so")
    assert limits(spread([1.0, 2.0, 8.0]), finding) == "(1 – 8)"
    assert limits(spread([0.0] * 14 + [100.0] * 6), finding) == "(0 with 14, 100 with 6 seeds)"
    assert limits(spread([3.0, 3.0]), finding) == ""
    assert limits(spread([3.0, np.nan]), finding) == ""
    assert limits(None, finding) == ""

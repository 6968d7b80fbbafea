"""Numbers as text."""

import numpy as np

from scenarios.thesis.finding import Finding
from scenarios.thesis.monte_carlo import spread
from scenarios.thesis.number_text import measure, number, p_value, parts, root, value_text
from scenarios.thesis.report import limits


def test_numbers_roots_and_parameters_as_text():
    values = (0.98765, 7.0, -2.5, 1234.5, np.nan)
    assert [number(value) for value in values] == ["0.9877", "7", "−2.500", "1234", "–"]
    assert [root(value) for value in (-0.5 + 0j, 0.5 - 0.25j)] == ["−0.500", "0.500 − 0.250j"]
    assert [value_text(value) for value in ((0.2, 0.17), 0.0261799387, "none")] == ["0.2 × 0.17", "0.02618", "none"]


def test_a_probability_too_small_to_compute_is_said_to_be_so():
    assert measure(0.0, Finding("F9", "partly", {}, "so")).startswith("< 1e"), "its numbers are p-values"
    assert measure(0.0, Finding("F22", "partly", {}, "so")) == "0"
    assert (p_value(0.0), p_value(0.0312)) == ("p < 1e-300", "p = 0.031")


def test_counts_are_shown_with_their_whole():
    value = {"shoulder_yaw": 0.9, "unstable": 1.0, "of": 8.0, "others": 2.0, "of as many as": 48.0}
    assert parts(Finding("F13", "partly", value, "so")) == [
        ("shoulder_yaw", "0.9000", None),
        ("unstable", "1", "8"),
        ("others", "2", "48"),
    ]
    assert parts(Finding("F13", "cannot be told", {}, "so")) == []


def test_ranges_are_counts_for_counts():
    finding = Finding("F13", "partly", {}, "so")
    assert limits(spread([1.0, 2.0, 8.0]), finding) == "(1 – 8)"
    assert limits(spread([3.0, 3.0]), finding) == ""
    assert limits(spread([3.0, np.nan]), finding) == ""
    assert limits(None, finding) == ""

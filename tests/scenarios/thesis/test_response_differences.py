"""Differences of responses that are known, and the best linear truth of a study."""

import numpy as np
import pytest

from scenarios.thesis.response_differences import (
    agree,
    best_linear_at,
    error_percent,
    largest_differences,
    response_of,
)


def test_the_best_linear_truth_is_the_measured_one_on_its_lines_and_smooth_between(study):
    for result in study.joints.values():
        measured = result.best_linear.response
        lines = measured.frequencies
        assert best_linear_at(result, lines) == pytest.approx(measured.response[:, 0, 0])
        between = 0.5 * (lines[3] + lines[4])
        ends = np.abs(best_linear_at(result, lines[3:5]) / response_of(result.truth.model, lines[3:5]))
        there = np.array([between])
        ratio = np.abs(best_linear_at(result, there) / response_of(result.truth.model, there))[0]
        assert ends.min() * 0.98 <= ratio <= ends.max() * 1.02


def test_the_ratio_is_held_beyond_the_lines(study):
    result = next(iter(study.joints.values()))
    last = result.best_linear.response.frequencies[-1:]
    beyond = last + 3.0
    ratios = [best_linear_at(result, f) / response_of(result.truth.model, f) for f in (last, beyond)]
    assert ratios[0] == pytest.approx(ratios[1])


def test_differences_in_gain_and_phase():
    reference = np.array([1.0, 0.5j, -2.0])
    turned = reference * 2.0 * np.exp(-1j * np.pi / 6)
    assert largest_differences(turned, reference) == pytest.approx((20 * np.log10(2.0), 30.0))
    limits = {"decibel": 3.0, "degrees": 30.0}
    assert agree((2.9, 29.0), limits)
    assert not agree((3.0, 0.0), limits)
    assert not agree((0.0, 30.0), limits)


def test_errors_are_relative_to_the_norm_of_the_truth():
    truth = np.array([3.0, 4.0j])
    assert error_percent(truth, truth) == 0.0
    assert error_percent(truth + np.array([0.0, 1.0]), truth) == pytest.approx(20.0)

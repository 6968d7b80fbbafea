"""Responses of several joints, and how far models are from them."""

import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.joint_inputs import LIMIT
from scenarios.thesis.multi_input import (
    ALONE,
    INDEPENDENT,
    METHODS,
    SHARED,
    off_diagonal,
    pushed_by_others,
    relative_error,
    three_joint_truth,
)
from sysid import StateSpace


def _gains(D):
    n = len(D)
    return StateSpace(np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0)), np.array(D), None, 0.02)


def _one_pole(pole):
    return StateSpace(np.array([[pole]]), np.array([[1 - pole]]), np.ones((1, 1)), np.zeros((1, 1)), None, 0.02)


def test_the_truth_is_the_part_of_the_whole_arm(study):
    chosen = [JOINTS.index(joint) for joint in STUDIED_JOINTS]
    f = np.array([0.3, 1.0, 6.0])
    whole = study.truth.model.frequency_response(f)[:, chosen][:, :, chosen]
    np.testing.assert_allclose(three_joint_truth(study.truth).frequency_response(f), whole)


def test_what_lies_off_the_diagonal():
    assert off_diagonal(_gains([[1.0, 0.0], [0.0, 2.0]])) == 0.0
    assert off_diagonal(_gains([[4.0, 3.0], [0.0, 0.0]])) == pytest.approx(0.6)


def test_errors_of_all_channels_and_of_the_diagonal():
    true, estimate = _gains([[3.0, 0.0], [0.0, 4.0]]), _gains([[3.0, 1.0], [0.0, 2.0]])
    assert relative_error(estimate, true) == pytest.approx(np.sqrt(5.0) / 5.0)
    assert relative_error(estimate, true, diagonal=True) == pytest.approx(0.4)


def test_the_band_decides_what_counts():
    slow, fast = _one_pole(0.99), _one_pole(0.5)
    assert relative_error(slow, fast, band=(0.01, 0.02)) < 0.2 < 0.8 < relative_error(slow, fast, band=(2.0, 10.0))


def test_the_pushes_of_both_other_joints_are_added_up():
    model = _gains([[1.0, 0.0, 0.0], [0.1, 2.0, -0.3], [0.0, 0.5, 1.0]])
    shares = pushed_by_others(model, band=(0.1, 10.0))
    assert list(shares.values()) == pytest.approx([0.0, 0.2, 0.5])


def test_independent_waveforms_find_what_a_shared_one_cannot(study):
    matrix_models = {(entry.record, entry.method): entry for entry in study.multivariable.full}
    assert set(matrix_models) == {(record, method) for record in (SHARED, INDEPENDENT) for method in METHODS}
    for method in METHODS:
        shared, independent = matrix_models[SHARED, method], matrix_models[INDEPENDENT, method]
        assert shared.condition > LIMIT > independent.condition
        if method == ALONE:
            assert shared.coupling == independent.coupling == 0.0
            assert shared.error < 2 * independent.error
        else:
            assert shared.error > independent.error

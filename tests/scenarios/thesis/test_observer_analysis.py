"""Observers of chapter V: what their numbers mean, on systems that are known and on the small study."""

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS
from scenarios.thesis.observer_analysis import ORDER, P, hankel_share, observer, observer_poles
from sysid import IOData, StateSpace, simulate

SYSTEM = StateSpace([[1.5, -0.7], [1.0, 0.0]], [[1.0], [0.0]], [[0.1, 0.05]], [[0.0]], None, 0.02)


def record(noise, samples=4000, level=0.0):
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 2), 2)
    return IOData(u + level, simulate(SYSTEM, u)[:, 0] + noise * rng.standard_normal(samples) + level, 0.02)


def test_two_states_describe_a_system_of_two_states():
    realised = observer(record(1e-6))
    assert hankel_share(realised, 2) == pytest.approx(100.0, abs=1e-6)
    assert hankel_share(realised, 1) < 99.0
    assert hankel_share(realised, 1, power=1) < hankel_share(realised, 1) < hankel_share(realised, 2)


def test_every_joint_has_its_observer(study):
    assert tuple(study.observers) == STUDIED_JOINTS
    for joint, entry in study.observers.items():
        assert [share.order for share in entry.shares] == list(range(1, P + 1))
        shares = [share.squared for share in entry.shares]
        assert shares == sorted(shares)
        assert shares[-1] == pytest.approx(100.0), "five observer parameters make a recursion of order five"
        model = study.joints[joint].models["okid"]
        assert np.abs(observer_poles(model.estimate.model)).max() < 1.0
        assert entry.shares[ORDER - 1].simulation == model.fits[study.estimation_test].simulation


def test_markov_parameters_are_those_of_the_truth_where_nothing_rubs(study):
    for joint in STUDIED_JOINTS:
        smooth = observer(study.campaigns[1].single(study.estimation_test, joint))
        system = np.asarray(smooth.diagnostics["system_markov"])[:, 0, 0]
        true = study.truth.joint(joint).model.markov(len(system))[:, 0, 0]
        assert np.abs(system - true).max() < 0.1 * np.abs(true).max()

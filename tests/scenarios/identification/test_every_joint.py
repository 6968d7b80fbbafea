"""The seven-joint model from records of a linear arm whose coupling is known."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import JOINTS, linearize, load_arm
from scenarios.experiments.registry import load
from scenarios.identification.every_joint import FLOOR, LEVEL, MULTISINES, SETTING, campaign, seven_joints
from tests.scenarios.thesis.conftest import joint_log

FEWER = replace(MULTISINES, realisations=3)


@pytest.fixture(scope="module")
def truth():
    scenario = load(SETTING)
    return linearize(load_arm(scenario.variant, scenario.payload), scenario.pose, amplitudes=())


def records(truth, experiments, *, coupling):
    """Logs of the linear arm, with noise of the resolvers; without coupling of seven joints side by side."""
    rng, logs = np.random.default_rng(1), []
    paths = truth.subset(JOINTS, JOINTS)
    for experiment in experiments:
        # Wires and velocity limit: what a command has beyond the lines tells the delay.
        wanted, limit = experiment.offsets() + 7e-4 * rng.standard_normal((900, 7)), 0.02 * load_arm().velocity_limits
        offsets = np.zeros_like(wanted)
        for k in range(1, len(wanted)):
            offsets[k] = offsets[k - 1] + np.clip(wanted[k] - offsets[k - 1], -limit, limit)
        if coupling:
            moved = sysid.simulate(replace(paths, K=None), offsets)
        else:
            alone = [replace(truth.channel(name, name), K=None) for name in JOINTS]
            moved = np.column_stack([sysid.simulate(one, offsets[:, [k]])[:, 0] for k, one in enumerate(alone)])
        measured = truth.angles + moved + 2e-5 * rng.standard_normal(moved.shape)
        logs.append(joint_log(experiment.name, truth.angles + offsets, measured, truth.angles + moved))
    return logs


def test_campaign_moves_all_joints_at_once_with_phases_of_its_own_seed():
    experiments = campaign(FEWER, seed=3)
    assert len(experiments) == 21
    assert {(one.variant, one.pose, one.axes) for one in experiments} == {("released", "home", JOINTS)}
    period = np.hstack([one.offsets()[: MULTISINES.samples].T for one in experiments[:7]])
    # Over the records of a realisation the waveforms of all joints are orthogonal.
    np.testing.assert_allclose(np.corrcoef(period), np.eye(7), atol=1e-9)
    assert not np.allclose(experiments[0].offsets(), campaign(FEWER, seed=4)[0].offsets())
    assert campaign(FEWER)[0] == campaign(FEWER)[0]


@pytest.mark.slow
def test_model_of_a_linear_arm_is_its_truth(truth, monkeypatch):
    monkeypatch.setattr("scenarios.identification.every_joint.ORDERS", ((3, 4), (5, 5)))
    experiments = campaign(FEWER, seed=3)
    found = seven_joints(experiments, records(truth, experiments, coupling=True))
    for path in found.paths:
        assert path.delay == path.truth.delay_samples == (1 if path.truth.name == "shoulder_pitch" else 2)
        assert 0.997 * path.hz[1] < path.truth.bandwidth_hz < 1.003 * path.hz[2]
        assert path.bare[0] == pytest.approx(path.truth.bandwidth_hz, rel=8e-3)
    assert (~found.coupled).sum() == 24
    np.testing.assert_array_equal(found.coupled, found.coupled.T)
    plain = found.true_gain > 1e-3
    np.testing.assert_allclose(found.coupling.gain[plain], found.true_gain[plain], rtol=0.01, atol=3e-4)
    assert found.significant[plain].all()
    assert (found.significant & ~found.coupled).sum() <= 2
    assert 1e6 * found.true_gain[~found.coupled].max() < found.true_gain[found.coupled].min() > FLOOR


@pytest.mark.thorough
def test_seven_joints_side_by_side_have_no_coupling(truth, monkeypatch):
    monkeypatch.setattr("scenarios.identification.every_joint.ORDERS", ((3, 4),))
    experiments = campaign(FEWER, seed=5)
    found = seven_joints(experiments, records(truth, experiments, coupling=False))
    off = ~np.eye(7, dtype=bool)
    # 42 paths, one in a hundred called: four or more once in a thousand campaigns.
    assert (found.coupling.p[off] < LEVEL).sum() < 4
    assert found.coupling.gain[off].max() < 1e-3

"""A shared waveform cannot tell the joints apart, a waveform for each axis can; each joint alone needs neither."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog, linearize, load_arm, simulate
from scenarios import Excitation, Scenario, load, names
from scenarios.experiments.joint_inputs import LAGS, LIMIT, JointInputs, joint_inputs, moved_joints, settled_inputs

COLUMNS = [JOINTS.index(joint) for joint in STUDIED_JOINTS]
FREQUENCIES = np.array([0.25, 0.5, 1.0, 2.0, 3.0])


@pytest.fixture(scope="module")
def logs() -> dict[str, JointLog]:
    chosen = [replace(load(name), duration=40.0) for name in ("mimo-7", "mimo-7-independent")]
    return {log.name: log for log in simulate(chosen)}


def test_a_shared_waveform_is_flagged_and_independent_ones_are_not(logs: dict[str, JointLog]) -> None:
    shared, apart = (settled_inputs(log.commanded, load(name)) for name, log in logs.items())
    assert shared is not None and apart is not None
    assert shared.condition > 5 * LIMIT
    assert (shared.full, shared.block_diagonal) == (False, True)
    assert "no full model of several inputs can be identified" in str(shared.warning())
    assert apart.condition < LIMIT / 5
    assert (apart.full, apart.block_diagonal, apart.warning()) == (True, True, None)


def test_estimates_bear_the_verdicts_out(logs: dict[str, JointLog]) -> None:
    true = linearize(load_arm()).model.frequency_response(FREQUENCIES)[:, COLUMNS][:, :, COLUMNS]
    full, diagonal = {}, {}
    for name, log in logs.items():
        data = sysid.IOData(log.commanded[200:, COLUMNS], log.measured[200:, COLUMNS], log.dt).detrend()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sysid.SysidWarning)
            model = sysid.okid(data, 6, p=5).model
            alone = [sysid.okid(sysid.IOData(data.u[:, i], data.y[:, i], data.dt), 2, p=5).model for i in range(3)]
        full[name] = np.abs(model.frequency_response(FREQUENCIES) - true).max()
        diagonal[name] = max(
            np.abs(entry.frequency_response(FREQUENCIES)[:, 0, 0] - true[:, i, i]).max()
            for i, entry in enumerate(alone)
        )
    # Errors of gains that are one at 0 Hz; friction alone accounts for 0.1.
    assert full["mimo-7"] > 0.25
    assert full["mimo-7-independent"] < 0.12
    assert max(diagonal.values()) < 0.12


def signals(*columns: np.ndarray) -> np.ndarray:
    commands = np.zeros((len(columns[0]), len(JOINTS)))
    commands[:, COLUMNS[: len(columns)]] = np.column_stack(columns)
    return commands


def measured(*columns: np.ndarray, lags: int = LAGS) -> JointInputs:
    inputs = joint_inputs(signals(*columns), STUDIED_JOINTS[: len(columns)], lags=lags)
    assert inputs is not None
    return inputs


def test_the_condition_is_that_of_the_correlation_whatever_the_size() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 40_000))
    for rho in (0.0, 0.6, 0.99):
        found = measured(a, 50.0 * (rho * a + np.sqrt(1 - rho**2) * b), lags=4)
        # Eigenvalues of the correlation matrix of two signals are 1 +- rho.
        assert found.condition == pytest.approx(np.sqrt((1 + rho) / (1 - rho)), rel=0.05)
        assert found.covariance_condition == pytest.approx(found.condition**2, rel=0.1)


def test_the_colour_of_a_single_command_does_not_count() -> None:
    rng = np.random.default_rng(1)
    smooth = np.cumsum(rng.standard_normal((40_000, 2)), axis=0)
    smooth -= np.apply_along_axis(lambda x: np.convolve(x, np.ones(200) / 200, "same"), 0, smooth)
    found = measured(*smooth.T)
    assert found.condition < 1.5
    assert found.covariance_condition > 100.0
    assert found.full


def test_a_delayed_copy_within_the_lags_is_found_and_one_beyond_is_not() -> None:
    a = np.random.default_rng(2).standard_normal(5000)
    assert measured(a, np.roll(a, 3)).condition > 1e3
    assert measured(a, np.roll(a, LAGS + 1)).condition < 1.5


def test_a_tone_without_noise_is_too_poor_for_a_block_diagonal_model_as_well() -> None:
    t = np.arange(2000) / 50
    found = measured(np.sin(2 * np.pi * t), np.sin(4 * np.pi * t))
    assert found.orders == (2, 2)
    assert (found.full, found.block_diagonal) == (False, False)
    assert "excite to the orders 2, 2, expected 8" in str(found.warning())


def test_nothing_is_said_of_one_joint_of_joints_at_rest_and_of_short_records() -> None:
    a = np.random.default_rng(3).standard_normal(200)
    assert joint_inputs(signals(a), STUDIED_JOINTS[:2]) is None
    assert joint_inputs(signals(a[:20], a[20:40]), STUDIED_JOINTS[:2]) is None


def test_joints_at_rest_are_left_out() -> None:
    a, b = np.random.default_rng(4).standard_normal((2, 500))
    found = measured(a, 1e-12 * b, b)
    assert found.joints == (STUDIED_JOINTS[0], STUDIED_JOINTS[2])
    assert found.condition < 2.0


def test_joints_compared_are_those_of_the_stick_or_of_the_thesis() -> None:
    assert moved_joints(load("mimo-1")) == STUDIED_JOINTS
    assert moved_joints(load("siso-1-wrist_roll")) == ("wrist_roll",)
    two = Scenario("two", ("wrist_yaw", "elbow_pitch"), (Excitation("prbs"),))
    assert moved_joints(two) == ("wrist_yaw", "elbow_pitch")


def test_every_test_of_table_2_shares_its_waveform_and_is_flagged() -> None:
    """Commands alone show it; the full records stand in docs/tests.md."""
    from scenarios.experiments.preview import preview

    for name in ("mimo-4", "mimo-9", "mimo-13", *names("independent")):
        seen = preview(replace(load(name), duration=12.0))
        assert seen.inputs is not None
        assert seen.inputs.full == (name in names("independent")), (name, seen.inputs.condition)
        assert seen.inputs.block_diagonal

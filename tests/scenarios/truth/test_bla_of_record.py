"""The multisine that moves a joint as much as a test does, and what is true of the joint under it."""

import numpy as np
import pytest

from hmtb_twin import linearize, load_arm
from hmtb_twin.control.modes import joint_index
from scenarios.experiments.campaign import Condition, campaign_scenario
from scenarios.experiments.preview import preview
from scenarios.experiments.scenario import Scenario
from scenarios.truth.bla_of_record import CLOSE, best_linear_of_test
from sysid import IOData

JOINT = "elbow_pitch"


def commanded(setting: Scenario) -> IOData:
    """The command of a test; what the arm answers does not matter here."""
    u = preview(setting).commands[200:, joint_index(JOINT)]
    return IOData(u, u, 0.02).detrend()


@pytest.mark.slow
def test_without_friction_it_is_the_small_signal_truth() -> None:
    condition = Condition(friction=False)
    setting = condition.applied(campaign_scenario("siso-5-elbow_pitch", duration=24.0))
    record = commanded(setting)
    found = best_linear_of_test(setting, condition.arm(), [record], test="5", seed=3)
    truth = linearize(load_arm(), amplitudes=()).joint(JOINT).bandwidth_hz
    assert found.wanted_rms == pytest.approx(float(np.std(record.u)))
    assert found.command_rms == pytest.approx(found.wanted_rms, rel=2 * CLOSE)
    assert found.f_max == pytest.approx(3.5, abs=0.6)
    assert found.slewing > 0.3  # as the test's own command does
    assert found.hz == pytest.approx(truth, rel=0.005)
    assert found.ci95[0] <= found.hz <= found.ci95[1]
    assert found.half_power_hz == pytest.approx(truth, rel=0.01)
    assert found.cautions == ()
    assert "8 realisations" in found.described

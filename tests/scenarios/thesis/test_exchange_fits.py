"""The exchange, phase by phase."""

import numpy as np
import pytest

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.rpcm import PHASES


def test_phases_follow_each_other_and_the_unit_is_carried_in_the_right_ones(study):
    exchange_fits = study.multivariable.exchange
    assert tuple(phase.name for phase in exchange_fits.phases) == PHASES
    for one, other in zip(exchange_fits.phases, exchange_fits.phases[1:], strict=False):
        assert one.end == other.start
    loaded = {phase.name: phase.loaded for phase in exchange_fits.phases}
    assert loaded["approach"] < 0.1
    assert loaded["transfer"] == loaded["align"] == 1.0
    assert 0.0 < exchange_fits.loaded < 1.0


def test_the_arm_goes_far_from_the_operating_point(study):
    exchange_fits, log = study.multivariable.exchange, study.campaign.log(RPCM)
    yaw = JOINTS.index("shoulder_yaw")
    settled = log.true_angles[round(SETTLING / log.dt) :, yaw]
    assert exchange_fits.departure["shoulder_yaw"] == pytest.approx(np.abs(settled - study.truth.angles[yaw]).max())
    assert np.degrees(max(exchange_fits.departure.values())) > 10.0


def test_errors_are_those_of_the_whole_run_in_its_part(study):
    exchange_fits, data = study.multivariable.exchange, study.campaign.several(RPCM)
    phase = next(entry for entry in exchange_fits.phases if entry.name == "transfer")
    entry = study.multivariable.model("OKID")
    (fit,) = sysid.compare(entry.model, data)
    part = slice(round((phase.start - SETTLING) / data.dt), round((phase.end - SETTLING) / data.dt))
    for i, joint in enumerate(STUDIED_JOINTS):
        for values, of in ((fit.simulated, phase.simulation), (fit.predicted, phase.one_step)):
            error = np.sqrt(np.mean((data.y[part, i] - values[part, i]) ** 2))
            assert of[entry.name][joint] == pytest.approx(error, rel=1e-9)

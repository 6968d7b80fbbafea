from dataclasses import dataclass

import numpy as np
import pytest

from hmtb_twin import JointLog, Status, TwinError, simulate
from hmtb_twin.parameters.variants import JOINTS, MOTIONS
from hmtb_twin.run.live_run import LiveRun
from tests.hmtb_twin.altered_arms import UPPER, equal


class PassOn:
    """Passes requests on, and remembers what it saw."""

    def __init__(self, change=lambda k, requested: requested):
        self.change, self.seen, self.restarts = change, [], []

    def restart(self, command):
        self.restarts.append((len(self.seen), command))

    def command(self, requested, measured, sent):
        self.seen.append((requested, measured, sent))
        return self.change(len(self.seen) - 1, requested)


def controlled(experiment, controller, **settings):
    @dataclass(frozen=True)
    class Controlled(experiment):
        def controller(self):
            return controller

    return Controlled(**settings)


def test_a_controller_that_passes_requests_on_changes_nothing(experiment):
    settings = {"axes": ("shoulder_yaw", "elbow_pitch"), "duration": 2.0}
    controller = PassOn()
    log, plain = simulate([controlled(experiment, controller, **settings), experiment(**settings)])
    for name in ("commanded", "measured", "true_angles", "status", "counts"):
        np.testing.assert_array_equal(getattr(log, name), getattr(plain, name))
    np.testing.assert_array_equal(log.requested, plain.commanded)
    assert plain.requested is None
    requested, measured, sent = map(np.array, zip(*controller.seen, strict=True))
    # It sees what the log holds: the bus delays among it.
    np.testing.assert_array_equal(measured, log.measured)
    np.testing.assert_array_equal(requested, log.requested)
    np.testing.assert_array_equal(sent[1:], log.commanded[:-1])
    assert [k for k, _ in controller.restarts] == [0]


def test_its_commands_keep_velocity_limits_ranges_and_the_pin(experiment):
    def change(k, requested):
        return requested + (5.0 if k >= 10 else 0.0)

    (log,) = simulate([controlled(experiment, PassOn(change), duration=12.0, amplitude=0.0)])
    step = np.array([MOTIONS[name].velocity_limit for name in JOINTS]) * log.dt
    assert (np.abs(np.diff(log.commanded, axis=0)) <= step + 1e-12).all()
    assert (log.status[12:50] & Status.VELOCITY_LIMITED).all()
    assert log.status[-1] & Status.JOINT_LIMITED
    assert log.commanded[-1, 0] == log.requested[-1, 0]
    np.testing.assert_allclose(log.commanded[-1, 1:], UPPER[1:])


def test_shutdown_restarts_it_where_the_arm_stands(experiment):
    controller = PassOn(lambda k, requested: requested + 0.01 * np.arange(7))
    (log,) = simulate([controlled(experiment, controller, duration=2.0, shutdown=(0.5, 1.0))])
    off = slice(25, 51)  # the tick of the reset still commands the present pose
    np.testing.assert_array_equal(log.commanded[off], log.requested[off])
    assert len(controller.restarts) == 1 + 26
    np.testing.assert_array_equal(controller.restarts[-1][1], log.commanded[50])


def test_live_runs_and_files_keep_it(experiment, tmp_path):
    settings = {"duration": 1.0}
    (log,) = simulate([controlled(experiment, PassOn(), **settings)])
    live = LiveRun(controlled(experiment, PassOn(), **settings))
    while live.step() is not None:
        pass
    assert equal(live.log(), log)
    assert equal(JointLog.load(log.save(tmp_path / "log.nc")), log)
    assert log.provenance["controller"].endswith("PassOn")


@pytest.mark.parametrize("answer", [np.zeros(6), np.full(7, np.nan), None])
def test_commands_that_are_none_end_the_run(experiment, answer):
    logs = simulate([controlled(experiment, PassOn(lambda k, r: answer), duration=1.0)])
    assert "its joint controller gave" in logs.failed["binary"]


def test_a_controller_needs_its_methods(experiment):
    with pytest.raises(TwinError, match="restart"):
        simulate([controlled(experiment, object(), duration=1.0)])

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import TwinError, simulate
from hmtb_twin.control.experiment import Motion, Status
from hmtb_twin.run.live_run import LiveRun, frame_of
from scenarios.experiments.registry import load
from scenarios.experiments.scenario import Scenario

CHANNELS = ("commanded", "sent", "measured", "true_angles", "wrench", "load_pressure", "status", "volts", "counts")


@pytest.fixture(scope="module")
def scenario():
    return replace(load("siso-5-elbow_pitch"), duration=4.0)


def run(live, ticks=None):
    frames = []
    while len(frames) != ticks and (frame := live.step()) is not None:
        frames.append(frame)
    return frames


def same(log, other, ticks=None):
    for name in CHANNELS:
        mine, theirs = getattr(log, name), getattr(other, name)
        if mine is None:
            assert theirs is None
        else:
            np.testing.assert_array_equal(mine, theirs[:ticks], err_msg=name)


def test_a_live_run_has_the_bits_of_a_simulation(scenario):
    live = LiveRun(scenario)
    frames = run(live)
    (log,) = simulate([scenario])
    same(live.log(), log)
    assert live.log().provenance == log.provenance
    assert [frame.tick for frame in frames] == list(range(1, 201))
    for frame in frames[:-1]:
        at = frame_of(log, frame.tick)
        np.testing.assert_array_equal(frame.angles, at.angles)
        np.testing.assert_array_equal(frame.wrench, at.wrench)
        # the command in force is that of the tick before: it moved the arm to here
        before = frame_of(log, frame.tick - 1)
        np.testing.assert_array_equal(frame.command, before.command)
        np.testing.assert_array_equal(frame.measured, before.measured)


def test_power_that_is_switched_live_is_a_planned_shutdown(scenario):
    live = LiveRun(scenario)
    run(live, 50)
    live.switch_power(on=False)
    assert not live.powered
    (frame,) = run(live, 1)
    assert frame.status & Status.SHUT_DOWN
    run(live, 49)
    live.switch_power(on=True)
    run(live)
    assert live.experiment.shutdown == (1.0, 2.0)
    (log,) = simulate([live.experiment])
    same(live.log(), log)
    assert Scenario.from_toml(live.log().provenance["scenario"]).shutdown == (1.0, 2.0)


def test_a_run_that_is_stopped_keeps_its_record(scenario):
    live = LiveRun(scenario)
    run(live, 77)
    log = live.log()
    assert len(log) == 77
    same(log, simulate([scenario])[0], 77)
    assert live.step() is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tick", "on", "made"),
    [
        (20, False, (0.4,)),
        (50, False, (1.0,)),
        (50, True, ()),
        (60, False, (1.0,)),
        (60, True, (1.0, 1.2)),
        (100, False, (1.0,)),
        (150, False, (1.0, 2.0, 3.0)),
    ],
)
def test_power_that_is_switched_live_drops_what_was_planned_for_later(scenario, tick, on, made):
    live = LiveRun(replace(scenario, shutdown=(1.0, 2.0)))
    run(live, tick)
    live.switch_power(on=on)
    run(live)
    assert live.experiment.shutdown == made
    same(live.log(), simulate([replace(scenario, shutdown=made)])[0])


def test_power_is_switched_only_while_the_arm_runs(scenario):
    live = LiveRun(scenario)
    with pytest.raises(TwinError, match="only while the arm runs"):
        live.switch_power(on=False)
    run(live)
    with pytest.raises(TwinError, match="only while the arm runs"):
        live.switch_power(on=False)


def test_a_run_without_a_tick_has_no_log(scenario):
    with pytest.raises(TwinError, match="nothing was recorded"):
        LiveRun(scenario).log()


class Stuck(Scenario):
    """A scenario whose operator breaks off after a second."""

    def operator(self):
        return self

    def move(self, view):
        return Motion(np.full(1, np.nan if view.time > 1.0 else 0.5))


def test_a_failure_ends_the_run_and_is_reported(scenario):
    live = LiveRun(Stuck("stuck", ("elbow_pitch",), (), duration=4.0))
    frames = run(live)
    assert "expected 1 finite numbers" in live.failure
    assert len(frames) == 51
    assert len(live.log()) == 51

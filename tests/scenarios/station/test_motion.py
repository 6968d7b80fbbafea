from dataclasses import replace

import numpy as np

from hmtb_twin import simulate
from hmtb_twin.control.experiment import Motion as Sticks
from hmtb_twin.run.live_motion import Motion
from hmtb_twin.run.live_run import frame_of
from scenarios.experiments.registry import load
from scenarios.experiments.scenario import Scenario
from tests.refusals import refused
from tests.scenarios.station.conftest import wait_until

SHORT = replace(load("siso-5-elbow_pitch"), duration=2.0)


class Moved:
    """Keeps what a motion shows and how it ends."""

    def __init__(self):
        self.shown, self.watched, self.ends = [], [], []
        self.motion = Motion(self.shown.append)

    def run(self, scenario, speed=None):
        self.motion.run(scenario, speed=speed, watch=self.watched.append, done=lambda *end: self.ends.append(end))
        return self

    def ended(self):
        wait_until(lambda: not self.motion.running)
        return self


def test_every_tick_is_watched_once_and_the_last_one_shown():
    moved = Moved().run(SHORT).ended()
    ticks = [frame.tick for frames in moved.watched for frame in frames]
    assert ticks == list(range(1, 101))
    assert moved.shown[-1].tick == 100
    assert len(moved.shown) == len(moved.watched) == moved.motion.pictures
    ((log, why),) = moved.ends
    assert why is None
    np.testing.assert_array_equal(log.measured, simulate([SHORT])[0].measured)


def test_a_replay_shows_the_log_from_a_time_on():
    (log,) = simulate([SHORT])
    moved = Moved()
    moved.motion.replay(
        log, first=1.5, speed=50.0, watch=moved.watched.append, done=lambda *end: moved.ends.append(end)
    )
    moved.ended()
    frames = [frame for frames in moved.watched for frame in frames]
    assert [frame.tick for frame in frames] == list(range(75, 100))
    np.testing.assert_array_equal(frames[0].angles, frame_of(log, 75).angles)
    assert moved.ends == [(None, None)]


def test_one_thing_moves_the_arm_at_a_time():
    moved = Moved().run(replace(SHORT, duration=200.0), speed=1.0)
    refused("the arm is moving", moved.run, SHORT)
    moved.motion.stop()
    assert not moved.motion.running
    ((log, why),) = moved.ends
    assert why is None
    assert log is None or 0 < len(log) < 10_000


class Stuck(Scenario):
    """A scenario whose operator breaks off after half a second."""

    def operator(self):
        return self

    def move(self, view):
        return Sticks(np.full(1, np.nan if view.time > 0.5 else 0.5))


def test_a_failure_is_reported_with_the_record_and_the_next_run_goes_on():
    moved = Moved().run(Stuck("stuck", ("elbow_pitch",), (), duration=2.0)).ended()
    ((log, why),) = moved.ends
    assert "expected 1 finite numbers" in why
    assert len(log) == 26
    moved.run(SHORT).ended()
    assert moved.ends[-1][1] is None


def test_an_experiment_that_cannot_begin_is_reported():
    moved = Moved().run(replace(SHORT, plant=replace(SHORT.plant, supply_pressure=2.0))).ended()
    ((log, why),) = moved.ends
    assert log is None
    assert "hold" in why


def test_power_is_switched_while_it_runs():
    moved = Moved().run(SHORT, speed=4.0)
    moved.motion.switch_power(on=False)
    moved.ended()
    ((log, why),) = moved.ends
    assert why is None
    (time,) = Scenario.from_toml(log.provenance["scenario"]).shutdown
    np.testing.assert_array_equal(log.measured, simulate([replace(SHORT, shutdown=(time,))])[0].measured)

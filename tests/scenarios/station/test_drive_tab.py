import re
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from hmtb_twin import IDEAL, JointLog, Motion, Status, simulate
from hmtb_twin.run.live_motion import Motion as Mover
from hmtb_twin.run.live_run import LiveRun, frame_of
from scenarios.commands.cli import main
from scenarios.experiments.film import load_or_simulate
from scenarios.experiments.hand_drive import SPRING, Stick, displays
from scenarios.experiments.registry import load
from scenarios.experiments.rpcm import HOLSTER, PHASES, approach_point, rpcm_outcome, task_operator
from scenarios.experiments.scenario import Scenario
from scenarios.station.drive_tab import ALL, WORKSITE, DriveTab, axis_choices, drive, drive_fields
from scenarios.station.stick_pad import KEYS, LET_GO, PUSHES
from tests.scenarios.station.conftest import press, wait_until

VALUES = {field.name: field.initial for field in drive_fields("nominal")}
FREE = "free space, payload rpcm"


class Clock:
    """Time that stands until it is moved."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_springs_bring_the_stick_back():
    clock = Clock()
    stick = Stick(("x", "roll"), clock=clock)
    assert stick.volts() == {"x": 0.0, "roll": 0.0}
    stick.push("x", 2.0)
    stick.push("yaw", 5.0)  # no axis of this experiment
    clock.now = SPRING - 1e-6
    assert stick.volts() == {"x": 2.0, "roll": 0.0}
    stick.push("roll", -3.0)
    clock.now = SPRING
    assert stick.volts() == {"x": 0.0, "roll": -3.0}
    clock.now = 2 * SPRING
    assert not any(stick.volts().values())


def test_a_key_that_is_held_keeps_the_stick_out():
    clock = Clock()
    stick = Stick(("x",), clock=clock)
    seen = []
    for number in range(40):
        clock.now = number / PUSHES
        stick.push("x", 1.0)
        clock.now += 0.99 / PUSHES
        seen.append(stick.volts()["x"])
    assert seen == [1.0] * 40
    assert SPRING > 2.0 / PUSHES  # one push that the browser delays is no release


def driven(scenario, deflections, **options):
    """The log of a drive whose stick is pushed as at each tick of `deflections` (N, n_axes), V."""
    stick = Stick(scenario.axes, clock=Clock(), **options)
    live = LiveRun(replace(scenario, stick=stick))
    for row in deflections:
        for axis, volts in zip(scenario.axes, row, strict=True):
            stick.push(axis, volts)
        live.step()
    return live.log()


@dataclass(frozen=True)
class Played(Scenario):
    """The same volts from the excitation computer."""

    deflections: tuple[tuple[float, ...], ...] = ()

    def volts(self):
        return np.array(self.deflections)

    def operator(self):
        return None


@pytest.mark.parametrize("mode", ["single_joint_rate", "cartesian"])
@pytest.mark.parametrize("imperfect", [True, False])
def test_the_stick_goes_through_the_chain_of_the_experiments(mode, imperfect):
    values = VALUES | {"mode": mode, "place": FREE, "imperfect": imperfect, "seed": 3, "duration": 0.6}
    scenario = drive(values)
    deflections = np.zeros((30, 6))
    deflections[5:20, 0], deflections[12:28, 4] = 2.5, -12.0
    log = driven(scenario, deflections)
    common = {name: value for name, value in vars(scenario).items() if name != "stick"}
    (played,) = simulate([Played(**common, deflections=tuple(map(tuple, deflections)))])
    for channel in ("volts", "counts", "commanded", "status", "measured", "wrench"):
        np.testing.assert_array_equal(getattr(log, channel), getattr(played, channel), err_msg=channel)
    assert (log.status & Status.CONVERTER_SATURATED).any()
    assert np.array_equal(log.volts, deflections) is not imperfect
    assert log.provenance["operator"] == "scenarios.experiments.hand_drive.Stick"
    assert "scenario" not in log.provenance  # no file describes what a hand did


def test_the_fields_describe_the_drive():
    first = drive(VALUES)
    assert (first.payload, first.worksite, first.mode, len(first.axes)) == ("none", True, "cartesian_rate", 6)
    assert first.hand_controller == load("rpcm").hand_controller
    one = drive(VALUES | {"mode": "single_joint", "axes": "wrist_roll", "place": "free space, payload mdm"})
    assert (one.axes, one.payload, one.worksite) == (("wrist_roll",), "mdm", False)
    assert drive(VALUES | {"imperfect": False}).chain == IDEAL
    assert drive(VALUES | {"axes": "wrist_roll"}).axes == first.axes  # of another mode
    for choice in axis_choices("cartesian", "nominal"):
        assert drive(VALUES | {"mode": "cartesian", "axes": choice}).axes == (
            first.axes if choice == ALL else tuple(choice.split(", "))
        )


@pytest.fixture
def tab(page):
    station, client = page
    station.session.memory.clear()
    for path in station.session.folder.glob("drive-*"):
        path.unlink()
    return DriveTab(station, client)


def fill(tab, **values):
    for name, value in values.items():
        tab._form.handles[name].value = value


def hold(tab, key):
    """One push of a button that is held, by its key."""
    (button,) = (pad[end] for place, pad in tab._pad._pads.items() for end in (0, 2) if KEYS[place][end > 0] == key)
    for pushed in button._impl.hold_cbs_from_freq[PUSHES]:
        pushed(SimpleNamespace(client=None, target=button))
    return button


def trigger(station, key):
    """One push of a key."""
    for command in station.server.gui._command_handle_from_uuid.values():
        if command.hotkey == key:
            for pushed in command._impl.trigger_cb:
                pushed(None)


def test_a_drive_is_recorded_kept_saved_and_replayed(tab, page, monkeypatch):
    station, client = page
    fill(tab, mode="single_joint_rate", place=FREE)
    tab.volts.value = 4.0
    assert not tab.buttons["Replay"].visible
    press(tab.buttons["Drive"])
    assert tab.buttons["End"].visible
    assert not tab.buttons["Close (C)"].visible
    trigger(station, "J")  # shoulder pitch up
    hold(tab, "R")  # the first wrist joint down
    wait_until(lambda: station.motion.pictures > 8)
    press(tab.buttons["Drive"])
    assert "the arm is moving" in client.notices[-1]
    press(tab.buttons["End"])
    log = station.session.records["drive-1"]
    assert 10 < len(log) < 100
    assert log.axes == tab._form.record().axes
    moved = np.abs(log.volts).max(axis=0) > 3.0
    assert [axis for axis, one in zip(log.axes, moved, strict=True) if one] == ["shoulder_pitch", log.axes[3]]
    assert "drive-1: " in tab._outcome.content
    assert "exchange" not in tab._outcome.content
    press(tab.buttons["Download .nc"])
    assert JointLog.load(station.session.folder / "drive-1.nc").commanded.shape == log.commanded.shape
    assert client.downloads["drive-1.nc"] == (station.session.folder / "drive-1.nc").read_bytes()
    assert ["hmtb", "view", str(station.session.folder / "drive-1.nc")] == list(tab.recipe().commands[1])
    frames = []
    monkeypatch.setattr(station.scene, "show", frames.append)
    mover = Mover(frames.append)
    mover.replay(log, speed=1000.0, watch=lambda _: None, done=lambda *_: None)
    mover.stop()
    np.testing.assert_array_equal(frames[-1].angles, frame_of(log, frames[-1].tick).angles)
    press(tab.buttons["Replay"])
    later = DriveTab(station, client)
    assert not later.buttons["Drive"].visible
    press(later.buttons["End"])
    assert later.buttons["Drive"].visible
    assert list(station.session.records) == ["drive-1"]
    assert tab._free_name() == "drive-2"


def test_a_browser_that_comes_back_steers_on(tab, page):
    station, client = page
    fill(tab, mode="cartesian", axes="z", imperfect=False, seed="12")
    tab.volts.value = 0.5
    press(tab.buttons["Drive"])
    later = DriveTab(station, client)
    assert later.buttons["EMERGENCY SHUTDOWN"].visible
    assert not later.buttons["Drive"].visible
    assert later.drive is tab.drive
    press(hold(later, "U"))  # released at once
    assert later.drive.stick.volts() == {"z": 0.0}
    hold(later, "O")
    assert later.drive.stick.volts() == {"z": -0.5}
    trigger(station, LET_GO)
    assert later.drive.stick.volts() == {"z": 0.0}
    trigger(station, "C")
    assert later.drive.stick.grip
    wait_until(lambda: station.motion.pictures > 2)
    press(later.buttons["EMERGENCY SHUTDOWN"])
    wait_until(lambda: "SHUT DOWN" in later._displays.content)
    press(later.buttons["End"])
    assert "shut down" in later._outcome.content
    assert "not inserted" in later._outcome.content
    assert later._form.record() == drive(
        VALUES | {"mode": "cartesian", "axes": "z", "imperfect": False, "seed": 12, "place": WORKSITE}
    )
    assert later.buttons["Drive"].visible


@pytest.mark.parametrize(
    ("field", "typed", "expected"),
    [
        ("seed", "-1", "seed"),
        ("seed", "1.5", "whole number"),
        ("duration", "0", "expected a duration"),
        ("duration", "nan", "expected a duration"),
        ("variant", "flight", "expected an arm on the ground"),
    ],
)
def test_the_field_says_what_is_wrong(tab, page, field, typed, expected):
    fill(tab, **{field: typed})
    assert expected in tab._form._messages[field].text
    press(tab.buttons["Drive"])
    assert "a field is wrong" in page[1].notices[-1]
    assert not page[0].motion.running


def test_a_drive_that_cannot_begin_is_reported(tab, page):
    fill(tab, duration="0.03")  # no whole number of ticks
    press(tab.buttons["Drive"])
    wait_until(lambda: not page[0].motion.running)
    assert "expected a positive multiple of 0.02 s" in tab._outcome.content
    assert tab.buttons["Drive"].visible
    assert not page[0].session.records


class Steered(Stick):
    """The stick in the hands of the operator of the study."""

    def __init__(self, scenario):
        super().__init__(scenario.axes, grip=False, clock=Clock())
        self._person = task_operator("rpcm", 4000, scenario.hand_controller)

    def move(self, view) -> Motion:
        wanted = self._person.move(view)
        for axis, volts in zip(self._deflections, wanted.volts, strict=True):
            self.push(axis, volts)
        self.grip = wanted.grip
        return super().move(view)


@pytest.mark.slow
def test_the_unit_is_inserted_with_the_stick_and_the_record_goes_to_the_commands(tab, page, capsys):
    station, _ = page
    scenario = drive(VALUES | {"seed": 4000, "duration": 150.0})
    scenario = replace(scenario, name="drive-1", stick=Steered(scenario))
    live, held, seen = LiveRun(scenario), False, []
    while frame := live.step():
        if live.tick % 25 == 1:
            seen.append(displays(frame, scenario))
        if held and not frame.status & Status.UNIT_HELD:
            break
        held = bool(frame.status & Status.UNIT_HELD)
    tab.done(live.log(), None)
    log = station.session.records["drive-1"]
    outcome = rpcm_outcome(log)
    assert outcome.inserted
    assert list(outcome.phases) == list(PHASES[: PHASES.index("insert") + 1])
    assert f"{outcome.peak_contact_force:.0f} N while inserting" in tab._outcome.content
    assert f">{outcome.phases['align'][1]:.1f}<" in tab._outcome.content
    height = 1e3 * (approach_point()[0][2] - HOLSTER.seated[0][2])
    assert seen[0][2] == f"tool to unit, mm and deg: x {height:+.0f}, y +0, z +0, roll +0, pitch +0, yaw +0"
    assert seen[0][0].endswith("end effector open")
    assert seen[-1][0].endswith("unit held, end effector closed")
    assert seen[-1][2].startswith("unit to its receptacle, mm and deg: x ")
    assert all(abs(int(number)) < 4 for number in re.findall(r"[+-]\d+", seen[-1][2]))
    press(tab.buttons["Save .nc"])
    identify, view, video = tab.recipe().commands
    assert main([*identify[1:], "--method", "arx", "--orders", "2", "2"]) == 0
    assert identify[-1] in capsys.readouterr().out
    for words in (view, video):
        np.testing.assert_array_equal(load_or_simulate(words[2]).measured, log.measured)
    exec(tab.recipe().python, {})
    assert capsys.readouterr().out.strip() == str(outcome)

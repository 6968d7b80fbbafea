from dataclasses import replace
from html import escape
from pathlib import Path
from time import sleep

import numpy as np
import pytest

from hmtb_twin import JointLog, simulate
from scenarios.commands.cli import main
from scenarios.experiments.preview import preview
from scenarios.experiments.recipe import scenario_recipe
from scenarios.experiments.registry import load
from scenarios.experiments.scenario import Scenario
from scenarios.station.experiment_tab import ExperimentTab, PreviewCard, preview_card
from sysid.recursive import track
from tests.scenarios.station.conftest import press, wait_until


@pytest.fixture
def tab(page):
    station, client = page
    station.session.prepare(replace(load("siso-5-elbow_pitch"), duration=4.0))
    one = ExperimentTab(station, client)
    wait_until(lambda: not station.work.label)
    return one


def message(tab, field):
    return tab._form._messages[field].text


def fill(tab, **values):
    for name, value in values.items():
        tab._form.handles[name].value = value


@pytest.mark.slow
def test_a_run_as_fast_as_it_goes_is_the_simulation_of_the_command_line(tab, page, tmp_path, monkeypatch):
    station, client = page
    tab._speed.value = "as fast as it goes"
    press(tab._run)
    wait_until(lambda: not station.motion.running)
    assert "siso-5-elbow_pitch: 4 s recorded" in tab._outcome.content
    press(tab._save)
    # A number follows the name where another test has saved one.
    saved = Path(client.notices[-1].removeprefix("Saved: "))
    assert saved.parent == station.session.folder and saved.name.startswith("siso-5-elbow_pitch")
    shown = JointLog.load(saved)
    words = tab._recipe._recipe()
    monkeypatch.chdir(tmp_path)
    (tmp_path / words.file).write_text(words.toml)
    for command in words.commands:
        assert main(command[1:]) == 0
    typed = JointLog.load("siso-5-elbow_pitch.nc")
    np.testing.assert_array_equal(shown.measured, typed.measured)
    np.testing.assert_array_equal(shown.commanded, typed.commanded)
    (tmp_path / "siso-5-elbow_pitch.nc").unlink()
    exec(words.python.replace('"siso', f'"{tmp_path}/siso'), {})
    np.testing.assert_array_equal(shown.measured, JointLog.load(tmp_path / "siso-5-elbow_pitch.nc").measured)


def test_a_registered_experiment_needs_no_file():
    assert scenario_recipe(load("siso-5-elbow_pitch")).shell.endswith("hmtb simulate siso-5-elbow_pitch")
    changed = scenario_recipe(replace(load("siso-5-elbow_pitch"), seed=1))
    assert changed.shell.endswith("hmtb simulate siso-5-elbow_pitch.toml")
    assert Scenario.from_toml(changed.toml).seed == 1


def test_a_run_keeps_real_time_and_stops_when_told(tab, page):
    station, _ = page
    press(tab._run)
    wait_until(lambda: station.motion.pictures > 20)
    press(tab._run)
    assert "the arm is moving" in page[1].notices[-1]
    press(tab._stop)
    assert not station.motion.running
    (log,) = station.session.records.values()
    assert 10 < len(log) < 200
    np.testing.assert_array_equal(log.measured, simulate([station.session.scenario])[0].measured[: len(log)])
    assert tab._run.visible
    assert not tab._stop.visible


def test_a_run_goes_on_while_its_page_is_loaded_again(tab, page):
    station, client = page
    press(tab._run)
    wait_until(lambda: station.motion.pictures > 5)
    station.session.forget_watchers()
    again = ExperimentTab(station, client)
    assert again._stop.visible
    assert again._emergency.visible
    assert not again._run.visible
    wait_until(lambda: "of 4 s" in again._state.text)
    press(again._stop)
    assert "s recorded" in again._outcome.content
    assert again._run.visible
    assert again._save.visible


@pytest.mark.slow
def test_the_bandwidth_that_follows_a_run_is_that_of_its_record(page, monkeypatch):
    station, client = page
    for module in ("live_track", "experiment_tab"):
        monkeypatch.setattr(f"scenarios.station.{module}.CALIBRATION", 15.0)
    station.session.prepare(replace(load("track-elbow_pitch"), duration=20.0, payload_changes=()))
    tab = ExperimentTab(station, client)
    tab._speed.value = "as fast as it goes"
    press(tab._run)
    wait_until(lambda: not station.motion.running)
    tab._track._thread.join()
    times, *drawn = tab._charts[2]._chart.data
    (log,) = station.session.records.values()
    followed = track(log.iodata(), calibration=15.0, gain=1.0)
    assert times == pytest.approx(np.arange(15.0, 20.0, 0.2))
    at = np.rint(times / log.dt).astype(int)
    np.testing.assert_array_equal(np.array(drawn).T, np.column_stack((followed.bandwidth, followed.bandwidth_ci95))[at])


def test_a_shutdown_by_hand_is_noted_in_the_scenario(tab, page):
    station, _ = page
    press(tab._run)
    wait_until(lambda: station.motion.pictures > 5)
    press(tab._emergency)
    wait_until(lambda: "SHUT DOWN" in tab._state.text)
    press(tab._stop)
    (time,) = station.session.scenario.shutdown
    (log,) = station.session.records.values()
    np.testing.assert_array_equal(log.measured, simulate([station.session.scenario])[0].measured[: len(log)])
    assert f"{time:g}" == tab._form.handles["shutdown"].value


@pytest.mark.parametrize(
    ("field", "typed", "expected"),
    [
        ("amplitude", "abc", "expected a number, given 'abc'"),
        ("amplitude", "", "expected a number"),
        ("amplitude", "1e309", "amplitude"),
        ("amplitude", "nan", "amplitude"),
        ("duration", "0", "expected a duration of 0.02 to"),
        ("duration", "1e12", "expected a duration of 0.02 to"),
        ("seed", "1.5", "expected a whole number"),
        ("seed", "-1", "seed"),
        ("name", "../x", "expected 1 to 100 letters"),
        ("name", "", "expected 1 to 100 letters"),
        ("shutdown", "soon", "expected times in s"),
        ("shutdown", "nan", "expected ascending times"),
    ],
)
def test_the_field_says_what_is_wrong(tab, page, field, typed, expected):
    before = page[0].session.scenario
    fill(tab, **{field: typed})
    assert expected in message(tab, field)
    assert [name for name in tab._form.handles if message(tab, name)] == [field]
    assert page[0].session.scenario == before
    press(tab._run)
    assert "a field is wrong" in page[1].notices[-1]
    assert not page[0].motion.running


def test_a_field_that_is_mended_says_nothing_more(tab, page):
    fill(tab, amplitude="x")
    fill(tab, amplitude="0.5")
    assert message(tab, "amplitude") == ""
    assert page[0].session.scenario.excitation[0].parameters["amplitude"] == 0.5


def test_another_mode_brings_axes_of_its_own(tab, page):
    fill(tab, mode="cartesian")
    assert page[0].session.scenario.axes == ("x",)
    assert "x, y, z" in tab._form.handles["axes"].options
    fill(tab, mode="single_joint_rate")
    assert page[0].session.scenario.axes == ("shoulder_yaw",)


def test_every_registered_scenario_fills_the_fields(tab, page):
    for name in ("siso-1-shoulder_yaw", "mimo-7", "mimo-7-independent", "rpcm"):
        scenario = load(name)
        page[0].session.prepare(scenario)
        assert tab._form.record() == scenario
        wait_until(lambda: not page[0].work.label)


@pytest.mark.slow
def test_the_preview_shows_the_words_of_the_command(tab, page):
    scenario = replace(load("mimo-7"), duration=12.0)
    seen, card = preview(scenario), preview_card(scenario)
    assert isinstance(card, PreviewCard)
    assert card.warnings == seen.warnings()
    assert all(escape(text) in card.html for text in seen.lines())
    page[0].session.prepare(scenario)
    # The work's label is empty before its result is shown: wait for the words themselves.
    wait_until(lambda: escape(seen.lines()[0]) in tab._preview.content)
    wait_until(lambda: tab._preview_warnings.text == "; ".join(seen.warnings()))


def test_a_preview_waits_for_other_work(tab, page):
    station, _ = page
    station.work.start("something else", sleep, 0.2, done=lambda _: None, failed=lambda _: None)
    scenario = replace(load("siso-5-elbow_pitch"), duration=5.0)
    line = escape(preview(scenario).lines()[0])
    station.session.prepare(scenario)
    wait_until(lambda: line in tab._preview.content)
    assert tab._previewed == scenario


def test_a_file_is_loaded_strictly(tab, page):
    text = replace(load("siso-5-elbow_pitch"), duration=6.0).to_toml()
    tab._load("mine.toml", text.encode())
    assert page[0].session.scenario.duration == 6.0
    for content, expected in ((b"\xff\xfe", "UTF-8"), (b"name = [", "mine.toml"), (b"colour = 1", "colour")):
        with pytest.raises(ValueError, match=expected):
            tab._load("mine.toml", content)


def test_a_run_that_cannot_start_is_reported(tab, page):
    station, _ = page
    heavy = replace(
        load("siso-5-elbow_pitch"), duration=1.0, plant=replace(station.session.scenario.plant, supply_pressure=2.0)
    )
    station.session.prepare(heavy)
    press(tab._run)
    wait_until(lambda: not station.motion.running)
    assert tab._run.visible
    assert "hold" in tab._state.text or "hold" in " ".join(page[1].notices)


@pytest.mark.slow
def test_saving_a_second_run_leaves_the_file_of_the_first(tab, page):
    station, client = page
    tab._speed.value = "as fast as it goes"
    for seed in ("7", "8"):
        fill(tab, seed=seed)
        press(tab._run)
        wait_until(lambda: not station.motion.running)
        press(tab._save)
    files = [Path(notice.removeprefix("Saved: ")) for notice in client.notices[-2:]]
    assert [JointLog.load(path).seed for path in files] == [7, 8]

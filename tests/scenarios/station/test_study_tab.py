import json
import math
import os
import shutil
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("viser")

from hmtb_twin import JointLog, simulate
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.run.live_motion import Playback
from scenarios.bench.metric import Metric
from scenarios.bench.result import Result
from scenarios.commands.cli import main
from scenarios.commands.verify_output import show
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.experiments.presentation import present_log
from scenarios.experiments.registry import load
from scenarios.files.record_file import write_record
from scenarios.station.opening import open_place
from scenarios.station.study_tab import CHOOSE, StudyTab
from scenarios.thesis.finding import CLAIMS
from tests.refusals import refused
from tests.scenarios.station.conftest import at_once, press, wait_until


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder of a scenario file and its log of 6 s, as the command writes it."""
    folder = tmp_path_factory.mktemp("made")
    scenario = replace(load("siso-6-elbow_pitch", duration=6.0), name="short")
    (folder / "short.toml").write_text(scenario.to_toml(), encoding="utf-8")
    simulate([scenario])[0].save(folder / "short.nc")
    return folder


@pytest.fixture(scope="module")
def log(made):
    return JointLog.load(made / "short.nc")


@pytest.fixture
def tab(page, monkeypatch):
    station, client = page
    monkeypatch.setattr(station.work, "start", at_once)
    yield StudyTab(station, client)
    station.motion.stop()
    station.session.memory.pop("Study", None)


def opened(tab, place, part=""):
    tab._place.value = str(place)
    tab._buttons.value = "Open"
    if part:
        tab._part.value = part
    return tab._opened


def steer(tab, word):
    tab._steering.value = word


def test_a_log_shows_the_numbers_of_the_command(tab, made, tmp_path, capsys):
    assert main(["simulate", str(made / "short.toml"), "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    ((_, _, (row,)),) = opened(tab, tmp_path / "short.nc").tables
    assert row[0] == "short" and row[1] == "6 s"
    assert [word for word in row[1:] if word in printed] == list(row[1:])
    page = tab._about.content
    assert all(word in page for word in (*row, "elbow_pitch", "rpcm_holster_out_approach", "ticks velocity limited"))
    assert tab._message.text == "" and tab._replay.visible and not tab._part.visible


def test_its_commands_work(tab, made, capsys):
    recipe = opened(tab, made / "short.nc").recipe
    assert [words[:2] for words in recipe.commands] == [("hmtb", "view"), ("hmtb", "video"), ("hmtb", "compare")]
    assert main(list(recipe.commands[2][1:])) == 0
    assert "truth" in capsys.readouterr().out
    names = {}
    exec(recipe.python, names)
    assert names["log"].name == "short"


def test_a_log_joins_the_records_once_and_outlives_the_browser(tab, page, made):
    station, client = page
    opened(tab, made / "short.nc")
    opened(tab, made / "short.nc")
    assert list(station.session.records) == ["short"]
    again = StudyTab(station, client)
    assert again._opened is not None and again._opened is tab._opened and again._about.content == tab._about.content
    assert "record short" in again._menu.options
    again._menu.value = "record short"
    assert again._opened.kind == "log of the twin"
    assert again._opened.recipe.commands[0] == ("hmtb", "simulate", "short.toml")


def test_a_replay_moves_the_arm_the_slider_and_the_plots(tab, page, made, log, monkeypatch):
    station, _ = page
    opened(tab, made / "short.nc")
    shown = []
    monkeypatch.setattr(station.motion, "_show", shown.append)
    tab._speed.value = "16"
    steer(tab, "Play")
    wait_until(lambda: not station.motion.running)
    assert [frame.tick for frame in shown] == sorted({frame.tick for frame in shown})
    assert len(shown) > 5 and np.array_equal(shown[-1].angles, log.true_angles[-1])
    assert tab._time.value == pytest.approx(5.98)
    time, command, measured, line = tab._plots[0]._chart.data
    assert np.array_equal(np.delete(command, [299, 300]), np.degrees(log.felt[:, 3]))
    assert np.array_equal(np.delete(measured, [299, 300]), np.degrees(log.measured[:, 3]))
    assert np.flatnonzero(np.isfinite(line)).tolist() == [299, 300] and set(time[[299, 300]]) == {5.98}
    assert tab._plots[2]._chart.title == "load pressure, elbow pitch / MPa"


def test_the_slider_is_dragged_at_rest_and_while_it_plays(tab, page, made, log, monkeypatch):
    station, client = page
    opened(tab, made / "short.nc")
    shown = []
    monkeypatch.setattr(station.scene, "show", shown.append)
    tab._time.value = 3.0
    assert tab._tick == 150 and np.array_equal(shown[-1].angles, log.true_angles[150])
    tab._speed.value, tab._loop.value = "0.25", True
    steer(tab, "Play")
    tab._time.value = 4.0
    wait_until(lambda: tab._tick >= 200)
    tab._speed.value = "16"
    assert (station.motion.playback.speed, station.motion.playback.loop) == (16.0, True)
    wait_until(lambda: tab._tick < 100)
    steer(tab, "Pause")
    assert not station.motion.running and station.motion.playback is None
    steer(tab, "To the start")
    assert tab._tick == 0 and client.notices == []


def test_only_one_thing_moves_the_arm(tab, page, made):
    station, client = page
    opened(tab, made / "short.nc")
    release = threading.Event()
    station.motion._start(release.wait)
    steer(tab, "Play")
    steer(tab, "Pause")
    release.set()
    assert client.notices == ["Not done: the arm is moving; stop it first"]


def test_playback_goes_on_where_it_is_told(log):
    playback = Playback(log, 5.96, loop=True)
    frames = playback.frames()
    assert [next(frames).tick for _ in range(4)] == [298, 299, 0, 1]
    playback.seek(99.0)
    playback.loop = False
    assert [frame.tick for frame in frames] == [299]


def test_a_scenario_is_simulated_first(tab, made, log):
    opened(tab, made / "short.toml")
    assert np.array_equal(tab._opened.log.measured, log.measured)
    assert tab._opened.recipe.toml and tab._recipe._save.visible


def test_a_record_of_the_bus_is_replayed_as_it_was_measured(tab, page, log, tmp_path):
    measured = np.array(log.measured)
    measured[:2] = measured[10:20] = np.nan
    path = write_record(replace(BusRecord.of(log), measured=measured), tmp_path / "bus.csv")
    seen = opened(tab, path).log
    assert np.array_equal(seen.measured[10:20], np.tile(log.measured[9], (10, 1)))
    assert np.array_equal(seen.measured[:2], np.tile(log.measured[2], (2, 1)))
    assert np.array_equal(seen.true_angles[20:], log.measured[20:])
    assert not page[0].session.records, "values that were held are no data"
    assert not tab._plots[2]._chart.visible
    measured[:, 4] = np.nan
    path = write_record(replace(BusRecord.of(log), measured=measured), path)
    refused("all values of a channel were lost", open_place, str(path))


STUDY = {
    "bandwidth": {
        "elbow_pitch": {
            "true_hz": 1.0346303,
            "best_linear": {"hz": 0.6715282},
            "recovered": {"oe": {"hz": None, "ci95": [0.9, 1.1], "covers": True}},
            "published": {"OKID (5.10)": 0.8912},
        }
    },
    "findings": {
        "F1": {
            "verdict": "partly",
            "frequency": {"verdicts": {"partly": 18, "reproduced": 2}, "depends_on_seed": True},
        },
        "F13": {"verdict": "reproduced"},
    },
    "answer": "the answer",
    "certainty": "how sure",
    "seed": 7,
    "duration": 6.0,
}


def study(folder, **changes):
    folder.mkdir(exist_ok=True)
    (folder / "results.json").write_text(json.dumps({**STUDY, **changes}), encoding="utf-8")
    return folder


def test_a_study_shows_its_verdicts_and_replays_its_tests(tab, made, tmp_path):
    folder = study(tmp_path / "study")
    findings, bandwidths = opened(tab, folder).tables
    assert list(findings[2]) == [
        ("F1", "partly", "depends on the seed: of 20 seeds 2 reproduced, 18 partly", CLAIMS["F1"].claim),
        ("F13", "reproduced", "", CLAIMS["F13"].claim),
    ]
    assert bandwidths[0] == "elbow_pitch: bandwidth of the best linear truth 0.672 Hz, small-signal 1.035 Hz"
    assert list(bandwidths[2]) == [
        ("OE 2/2, delay 2", "nan", "0.900 to 1.100", "yes"),
        ("published OKID (5.10)", "0.891", "", ""),
    ]
    assert not tab._replay.visible and "the answer" in tab._about.content
    tab._part.value = "siso-1-elbow_pitch"
    assert tab._opened.kind == "scenario, simulated now" and len(tab._opened.log) == 300
    shutil.copy(made / "short.nc", folder / "siso-2-elbow_pitch.nc")
    tab._part.value = "siso-2-elbow_pitch"
    assert tab._opened.log.name == "short" and tab._part.value == "siso-2-elbow_pitch"
    for damage in ({"findings": {"F99": {}}}, {"duration": "long"}, {"bandwidth": []}, {"answer": None}):
        refused("is no result of hmtb thesis", open_place, str(study(folder, **damage)))


def test_a_data_set_and_its_experiments(tab, tiny, tmp_path):
    assert "tiny-v1: 3 records, 2 to train, 0 to validation, 1 to test" in opened(tab, tiny).lines[0]
    name = tab._part.options[1]
    tab._part.value = name
    log = tab._opened.log
    assert log.name == name and "from the files" in tab._about.content
    public = shutil.copytree(tiny, tmp_path / tiny.name, ignore=shutil.ignore_patterns("truth"))
    again = open_place(str(public), name)
    assert np.array_equal(again.log.measured, log.measured) and "simulated again" in again.lines[1]
    refused("unknown experiment", open_place, str(tiny), "nothing")


def test_a_result_of_the_bench_reads_as_the_command_prints_it(tab, tmp_path, capsys):
    numbers = (1.234, 1.0, (0.9, 1.5), True, 1e-4, "why")
    result = Result(
        estimator=Estimator("mine", "mine:f", structure="oe", method="pem"),
        limits=Limits(),
        effort="quick",
        seed=3,
        command="hmtb verify mine:f --quick --seed 3",
        source="",
        versions={},
        machine="",
        outcomes={"model": 9, "hang": 1},
        reasons={},
        seconds=1.0,
        metrics={"bias": Metric("bias", "Bias", "percent", *numbers)},
    )
    (tmp_path / "mine.json").write_text(result.to_json(), encoding="utf-8")
    ((title, head, (row,)),) = opened(tab, tmp_path / "mine.json").tables
    show([result], tmp_path)
    printed = capsys.readouterr().out
    assert all(text in printed for text in (title, *head, *row)) and row[0] == "Bias, percent"
    assert tab._opened.recipe.commands == [("hmtb", "leaderboard", str(tmp_path / "mine.json"))]
    assert main(["leaderboard", str(tmp_path / "mine.json"), "--out", str(tmp_path)]) == 0


def test_files_of_the_folder_are_listed(tab, page, made):
    folder = page[0].session.folder
    shutil.copy(made / "short.nc", folder / "copied.nc")
    (folder / "copied.txt").touch()
    tab._buttons.value = "Refresh the menu"
    assert "copied.nc" in tab._menu.options and "copied.txt" not in tab._menu.options
    tab._menu.value = "copied.nc"
    assert tab._place.value == str(folder / "copied.nc") and tab._opened.place == str(folder / "copied.nc")
    (folder / "copied.nc").unlink()


@pytest.mark.slow
def test_what_cannot_be_opened_is_said_beneath_the_field(tab, made, log, tmp_path):
    whole = (made / "short.nc").read_bytes()
    foreign = {
        "cut.nc": (whole[: len(whole) // 2], "is not a NetCDF4 file, or a damaged one"),
        "text.nc": (b"no file of ours", "is not a NetCDF4 file"),
        "other.mat": (b"MATLAB 5.0 MAT-file" + bytes(200), "tables from elsewhere are for the tab Identify"),
        "table.csv": (b"t,u,y\n0,1,2\n", "tables from elsewhere"),
        "other.json": (b"{}", "expected a result of hmtb verify"),
        "bad.json": (b"{", "cannot read"),
        "bad.toml": (b"name = ", "bad.toml"),
    }
    for name, (content, expected) in foreign.items():
        (tmp_path / name).write_bytes(content)
        opened(tab, tmp_path / name)
        assert expected in tab._message.text, (name, tab._message.text)
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    for place, expected in {
        tmp_path / "pipe.toml": "expected a file",
        tmp_path / "endless.toml": "expected a file",
        "": "expected its path",
        "nothing": "unknown scenario 'nothing'",
        tmp_path / "none.nc": "no file or folder",
        tmp_path: "or the folder of a data set or a study",
    }.items():
        opened(tab, place)
        assert expected in tab._message.text
    assert tab._opened is None
    opened(tab, made / "short.nc")
    assert tab._message.text == ""
    assert tab._opened.log is not None
    channels = ("commanded", "measured", "true_angles", "wrench", "load_pressure", "volts", "counts", "status")
    stopped = replace(log, **{name: getattr(log, name)[:100] for name in channels})
    assert "2 s of 6 s were recorded" in present_log(stopped).lines
    named = present_log(replace(log, name="a\udc80b\n"))
    assert named.log.name == "a\N{REPLACEMENT CHARACTER}b"
    holes = np.array(log.true_angles)
    holes[5, 2] = math.nan
    refused("true_angles are no numbers", present_log, replace(log, true_angles=holes))
    refused("expected some every 0.02 s", present_log, replace(log, dt=0.01))
    refused("variant", present_log, replace(log, provenance={"variant": "marsian"}))
    assert present_log(replace(log, provenance={})).tables[0][2][0][2] == "", "clipping is unknown without the scenario"


def _until(path):
    while not path.exists():
        time.sleep(0.01)


def _endless(place, part):
    time.sleep(3600.0)


@pytest.mark.slow
def test_files_are_read_beside_the_page(page, made, monkeypatch):
    station, client = page
    tab = StudyTab(station, client)
    tab._place.value = str(made / "short.nc")
    tab._buttons.value = "Open"
    wait_until(lambda: not tab._stop.visible)
    assert tab._opened.log.name == "short" and tab._message.text == ""
    release = made / "release"
    station.work.start("something else", _until, release, done=lambda _: None, failed=lambda _: None)
    tab._place.value = "siso-5-elbow_pitch"
    monkeypatch.setattr("scenarios.station.study_tab.open_place", _endless)
    tab._buttons.value = "Open"
    assert tab._message.text == "opening siso-5-elbow_pitch begins after something else" and not tab._stop.visible
    release.touch()
    wait_until(lambda: station.work.label.startswith("opening"))
    assert tab._stop.visible and tab._message.text.endswith("...")
    press(tab._stop)
    wait_until(lambda: not tab._stop.visible)
    assert "was stopped" in tab._message.text
    assert tab._part.value == CHOOSE
    station.session.memory.pop("Study", None)

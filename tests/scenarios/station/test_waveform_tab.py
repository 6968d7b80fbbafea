"""The Waveform tab: its numbers are those of `hmtb waveform`, and what it shows goes into the experiment."""

import json
import re
from dataclasses import replace
from html import unescape
from inspect import signature
from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.commands.cli import main
from scenarios.experiments.excitation import COMPUTED, KINDS, UNITS
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.excitation_review import excitation_rows, excitation_summary
from scenarios.experiments.recipe import excitation_recipe
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import read_points, write_points
from scenarios.station.waveform_tab import EVERY_AXIS, LARGEST_FILE, WaveformTab
from tests.scenarios.station.conftest import press

FIELDS = {
    "sine": {"frequency": "3", "amplitude": "-0.5"},
    "two_sines": {"frequency": "1.25"},
    "multisine": {"f_min": "1", "f_max": "5", "odd": True, "seed": "3"},
    "prbs": {"clock": "3", "register": "12", "repeat_frequency": "1", "iterations": "4"},
    "sign_recursion": {"memory": "0.3", "as_printed": True},
    "chirp": {"f_start": "1", "amplitude": "12"},
    "chirp_as_printed": {"f_low": "1"},
    "chirp_franklin": {"f_start": "1", "f_end": "5", "offset": "-0.1"},
    "bipolar_ramping_pulse": {"pulse_width": "0.2", "growing": True},
    "white_noise": {"seed": "7"},
}


@pytest.fixture
def tab(page, monkeypatch):
    station, client = page
    # A figure takes a fifth of a second; one test draws it.
    monkeypatch.setattr("scenarios.station.waveform_tab.card", lambda figure, words, size: words)
    monkeypatch.setattr("scenarios.station.waveform_tab.waveform_figure", lambda wave: wave)
    monkeypatch.setattr("scenarios.experiments.preview_figure.waveform_figure", lambda wave: wave)
    monkeypatch.setattr("scenarios.report.figures.save_figure", lambda *_, **__: None)
    station.session.scenario, station.session.waveform = load("siso-5-elbow_pitch"), None
    yield WaveformTab(station, client)
    station.session.scenario, station.session.waveform = load("siso-5-elbow_pitch"), None


def enter(tab, kind, values):
    tab._kind.value = kind
    form = tab._forms[kind][1]
    for name, value in values.items():
        form.handles[name].value = value
    return form


def upload(tab, name, content):
    """Load a file as the browser does."""
    (button,) = (
        handle
        for handle in tab._client.gui._gui_input_handle_from_uuid.values()
        if getattr(handle, "mime_type", "").startswith("text/plain")
    )
    button._impl.value = SimpleNamespace(name=name, content=content)
    press(button)


def cells(html):
    return [
        tuple(unescape(cell) for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row))
        for row in re.findall(r"<tr>(.*?)</tr>", html)
    ]


def test_numbers_are_those_of_the_command_and_of_python(tab, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert set(FIELDS) == set(COMPUTED)
    for kind, values in FIELDS.items():
        enter(tab, kind, values)
        assert tab._shown.kind == kind
        recipe = tab._recipe._recipe()
        program, words = recipe.commands[0][0], recipe.commands[0][1:]
        assert program == "hmtb"
        assert main(words) == 0
        printed = {tuple(re.split(r"  +", line.strip())) for line in capsys.readouterr().out.splitlines()}
        rows = cells(tab._numbers.content)
        assert len(rows) == 5
        assert set(rows) <= printed, kind
        assert main([*words, "--overwrite", "--json"]) == 0
        output = json.loads(capsys.readouterr().out)
        assert tab._warnings.text == "; ".join(output["warnings"])
        needed = {name: str(order) for name, order in output["needed_order"].items()}
        assert {row[0]: row[1] for row in cells(tab._orders.content)[1:]} == needed
        names: dict = {}
        exec(recipe.python, names)
        assert names["excitation"] == tab._shown
        capsys.readouterr()
        press(tab._save)
        assert tab._client.downloads[f"{kind}.txt"] == (tmp_path / f"{kind}.txt").read_bytes()


@pytest.mark.slow
def test_points_and_spectrum_are_drawn(tab, monkeypatch):
    monkeypatch.undo()
    enter(tab, "white_noise", {})
    first = tab._figure.content
    assert "white_noise: 100 points and their spectrum</title>" in first
    enter(tab, "chirp", {})
    # Both could stand on one page: no identifier is taken twice.
    marks = [set(re.findall(r'\bid="([^"]*)"', text)) for text in (first, tab._figure.content)]
    assert all(marks)
    assert not marks[0] & marks[1]


def test_every_parameter_has_a_field_with_its_unit_and_words(tab):
    for kind, (_, form) in tab._forms.items():
        named = set(signature(KINDS[kind]).parameters) - {"points"}
        assert set(form.handles) == named | {"repeat_frequency", "iterations"}
        for name, handle in form.handles.items():
            assert handle.hint, (kind, name)
            assert (" / " in handle.label) == (name in UNITS or name == "repeat_frequency")
        if kind != "points":
            assert form.record() is not None, kind
    units = {name for kind in (*COMPUTED, "points") for name in signature(KINDS[kind]).parameters} - set(UNITS)
    assert units == {"points", "seed", "memory", "odd", "growing", "as_printed"}


@pytest.mark.parametrize(
    ("kind", "name", "typed", "words"),
    [
        ("prbs", "clock", "2.5", "expected a whole number, given '2.5'"),
        ("prbs", "clock", "90", "clock must be 1 to 33"),
        ("prbs", "seed", "-1", "a seed is a whole number"),
        ("prbs", "amplitude", "0", "excites nothing"),
        ("prbs", "amplitude", "1e-200", "excites nothing"),
        ("prbs", "amplitude", "nan", "amplitude"),
        ("prbs", "amplitude", "1e300", "at most 1000 V"),
        ("prbs", "amplitude", "<b>", "expected a number, given '<b>'"),
        ("sine", "frequency", "0.3", "does not repeat"),
        ("bipolar_ramping_pulse", "pulse_width", "3", "pulse width must be"),
        ("prbs", "repeat_frequency", "0", "repeat_frequency must be 1.16e-05 Hz"),
        ("prbs", "iterations", "few", "expected a whole number or nothing"),
    ],
)
def test_the_field_says_what_is_wrong(tab, kind, name, typed, words):
    form = enter(tab, kind, {})
    was = tab._shown
    form.handles[name].value = typed
    assert words in form._messages[name].text
    assert [key for key, message in form._messages.items() if message.text] == [name]
    assert tab._use.disabled
    assert tab._save.disabled
    assert tab._last == was
    press(tab._use)
    assert "a field is wrong" in tab._client.notices[-1]
    form.set(was.parameters | {"repeat_frequency": None, "iterations": None})
    assert not tab._use.disabled
    assert tab._shown == was


def test_what_is_shown_goes_into_the_experiment_and_comes_back(tab, page):
    station, client = page
    assert tab._shown == station.session.scenario.excitation[0]
    assert tab._state.text == "siso-5-elbow_pitch plays this"
    assert not tab._axis.visible
    enter(tab, "sine", {"frequency": "4"})
    assert "does not play this yet, it plays prbs" in tab._state.text
    again = WaveformTab(station, client)
    assert again._shown == tab._shown == Excitation("sine", {"frequency": 4.0})
    press(tab._use)
    assert station.session.scenario.excitation == (tab._shown,)
    assert tab._state.text == again._state.text == "siso-5-elbow_pitch plays this"
    # An experiment that changes elsewhere is followed, but nothing is lost that was entered and not used.
    other = load("siso-7-elbow_pitch")
    station.session.prepare(other)
    assert tab._shown == other.excitation[0]
    enter(tab, "sine", {"frequency": "6"})
    station.session.prepare(load("siso-8-elbow_pitch"))
    assert tab._shown == Excitation("sine", {"frequency": 6.0})
    press(tab._take)
    assert tab._shown == station.session.scenario.excitation[0]
    silent = replace(other, excitation=(Excitation("prbs", {"amplitude": 0.0}),))
    station.session.prepare(silent)
    assert tab._kind.value == "prbs"
    assert "excites nothing" in tab._forms["prbs"][1]._messages["amplitude"].text
    assert WaveformTab(station, client)._last == Excitation("chirp", {"f_start": 5.0, "f_end": 10.0})
    station.session.waveform = None
    assert "excites nothing" in WaveformTab(station, client)._forms["prbs"][1]._message.text


def test_one_axis_of_several_gets_it(tab, page):
    station, client = page
    mimo = load("mimo-5")
    station.session.prepare(mimo)
    assert tab._axis.visible
    assert tab._axis.options == (EVERY_AXIS, *mimo.axes)
    enter(tab, "chirp", {})
    tab._axis.value = mimo.axes[1]
    press(tab._use)
    assert station.session.scenario.played() == {**mimo.played(), mimo.axes[1]: tab._shown}
    assert "plays this" in tab._state.text
    enter(tab, "white_noise", {})
    tab._axis.value = mimo.axes[2]
    before = station.session.scenario
    press(tab._use)
    assert "3 different excitations" in client.notices[-1]
    assert station.session.scenario is before
    station.session.prepare(mimo)
    tab._axis.value = EVERY_AXIS
    press(tab._use)
    assert station.session.scenario.excitation == (tab._shown,)


def test_an_operator_plays_nothing(tab, page):
    station, client = page
    station.session.prepare(load("rpcm"))
    assert "an operator has the stick" in tab._state.text
    press(tab._take)
    press(tab._use)
    assert len(client.notices) == 2
    assert station.session.scenario == load("rpcm")


def test_a_file_is_loaded_and_saved_to_the_last_bit(tab, page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    points = np.random.default_rng(1).normal(size=100).tolist()
    content = write_points(points, tmp_path / "my points.txt").read_bytes()
    tab._kind.value = "file"
    assert "load a file" in tab._forms["points"][1]._message.text
    assert tab._use.disabled
    assert not tab._figure.visible
    upload(tab, "my points.txt", content)
    assert tab._shown.parameters["points"] == tuple(points)
    assert tab._figure.visible
    press(tab._save)
    assert page[1].downloads == {"my points.txt": content}
    recipe = tab._recipe._recipe()
    assert recipe.shell == "hmtb waveform file '--path=my points.txt'"
    assert main([*recipe.commands[0][1:], "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert {name: output[name] for name in excitation_summary(tab._shown)} == excitation_summary(tab._shown)
    names: dict = {}
    exec(recipe.python, names)
    assert names["excitation"] == tab._shown
    assert cells(tab._numbers.content) == excitation_rows(tab._shown)


@pytest.mark.parametrize(
    "content",
    [b"", b"1\n" * 99, b"1\n" * 101, b"1\n" * 41 + b"two\n" + b"1\n" * 58, b"\xff\xfe1", b"0\n" * 100, b"5000\n" * 100],
)
def test_a_bad_file_gets_the_error_of_the_reader(tab, tmp_path, content):
    shown = tab._shown
    upload(tab, "mine.txt", content)
    (notice,) = tab._client.notices
    (tmp_path / "mine.txt").write_bytes(content)
    try:
        read_points(tmp_path / "mine.txt")
    except ValueError as error:
        assert notice == f"Not done: {error}".replace(str(tmp_path / "mine.txt"), "mine.txt")
    else:
        assert "excites nothing" in notice
    assert tab._shown == shown


def test_a_large_file_is_refused_before_it_is_read(tab, monkeypatch):
    monkeypatch.setattr("scenarios.station.waveform_tab.parse_points", None)
    upload(tab, "mine.txt", b"1" * (LARGEST_FILE + 1))
    assert "65537 bytes" in tab._client.notices[0]


def test_a_recipe_names_only_what_differs():
    recipe = excitation_recipe(Excitation("multisine", {"odd": True, "amplitude": 1.0, "f_min": 1.0}), "")
    assert recipe.shell == "hmtb waveform multisine --f-min=1.0 --odd"

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import simulate
from scenarios.commands.cli import main
from scenarios.experiments.registry import load
from scenarios.identification import identified_models
from scenarios.identification.comparison_figures import FIGURES
from scenarios.identification.identified_models import IdentifiedModels
from scenarios.identification.methods import ESTIMATORS
from scenarios.station.identify_tab import CHOICE, COLUMNS, FILE, MENU, IdentifyTab
from tests.scenarios.station.conftest import at_once, press, wait_until

WORDS = {name: words for words, name in MENU.items()}


@pytest.fixture(scope="session")
def log():
    return simulate([replace(load("siso-5-elbow_pitch"), duration=40.0)])[0]


def drawn(models, kinds):
    """Instead of figures, which take seconds: what they would show."""
    return dict.fromkeys(FIGURES, " ".join([*(one.name for one in models), *kinds]))


@pytest.fixture
def tab(page, log, tmp_path, monkeypatch):
    station, client = page
    monkeypatch.setattr(station.session, "folder", tmp_path)
    monkeypatch.setattr(station, "identified", IdentifiedModels(station.work, station.session.tell))
    monkeypatch.setattr(identified_models, "draw_figures", drawn)
    monkeypatch.setattr(station.work, "start", at_once)
    station.session.keep(log)
    return IdentifyTab(station, client)


def fill(tab, **values):
    for name, value in values.items():
        tab._form.handles[name].value = value


def choose(tab, method, *orders):
    tab._estimator.value = WORDS[method]
    for slider, order in zip(tab._sliders.values(), orders, strict=True):
        slider.value = order


def act(tab, action):
    tab._action._impl.value = action
    press(tab._action)


def message(tab, field):
    return tab._form._messages[field].text


def spoken(command, capsys):
    assert main([*command[1:], "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_numbers_are_those_of_the_command_line(tab, page, log, capsys, tmp_path):
    station, client = page
    choose(tab, "armax", 2, 2, 1, 2)
    fill(tab, validate="its second half", skip="2", steps="5")
    press(tab._run)
    (model,) = station.identified.listed.values()
    command = model.request.words
    assert command[2:] == (
        str(tmp_path / f"{log.name}.nc"),
        *("--method", "armax", "--orders", "2", "2", "1", "2", "--skip", "2.0", "--steps", "5", "--held-out", "0.5"),
    )
    told, page_text = spoken(command, capsys), tab._cards["Numbers"].content
    hz, (low, high), fit = told["bandwidth_hz"], told["ci95"], told["fit"]
    # Friction distorts: what the parameters tell is not all.
    assert f">{hz:.4g} Hz, 95 % interval {low:.4g} to {high:.4g} Hz from the parameters, " in page_text
    for text in (
        *(f"{fit[key][0]:.2f} %" for key in ("simulation", "one_step", "ahead")),
        f"{told['dc_gain']:.4f}",
        f"{told['aic']:.5g}, {told['bic']:.5g}",
        *(f"{value:.6g}" for value in told["parameters"].values()),
        *(f"{value:.2g}" for value in told["deviations"].values()),
        *(f"warning: {text}" for text in told["warnings"]),
    ):
        assert f">{text}<" in page_text
    assert told["residuals"]["whiteness_p"][0] == model.found.result.test.whiteness_p[0]
    for text in (f"{fit['simulation'][0]:.2f}", f"{hz:.3f}", f"{low:.3f} to {high:.3f}"):
        assert f">{text}<" in tab._list.content
    assert main(command[1:]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    exec(tab._recipe._recipe().python, {})
    by_python = " ".join(capsys.readouterr().out.split())
    interval = f"{hz:.4g} Hz, 95 % interval {low:.4g} to {high:.4g} Hz"
    assert interval in printed and interval in by_python
    assert " ".join(command) in tab._recipe._text.content
    act(tab, "save as JSON")
    ((name, content),) = client.downloads.items()
    assert name == f"{log.name}-armax-2-2-1-2.json"
    (tmp_path / "by command").mkdir()
    saved = tmp_path / "by command" / name
    assert main([*command[1:], "--save", str(saved)]) == 0
    assert content == saved.read_bytes().replace(f"'{saved}'".encode(), name.encode())


@pytest.mark.slow
def test_truth_and_printed_models_are_those_of_hmtb_compare(tab, page, capsys):
    station, _ = page
    choose(tab, "oe", 2, 2, 1)
    fill(tab, validate="the same samples")
    press(tab._run)
    (model,) = station.identified.listed.values()
    models = ("truth", "published", "oe:2/2/1")
    told = spoken(("hmtb", "compare", str(model.request.data[0]), "--models", *models), capsys)["models"]
    assert [one["kind"] for one in told] == ["truth", "published", "published", "oe"]
    for one in told:
        assert f">{one['bandwidth_hz']:.3f}<" in tab._list.content
        assert f">{one['fit']['simulation'][0]:.2f}<" in tab._list.content
    truth, low, high = told[0]["bandwidth_hz"], *told[3]["ci95"]
    assert tab._list.content.count(">yes<" if low <= truth <= high else ">no<") == 1
    fill(tab, joint="wrist_roll")
    press(tab._run)
    assert "the input 'wrist_roll commanded' is constant" in tab._state.text


def test_orders_follow_the_estimator(tab):
    assert tab._estimator.value == CHOICE and not tab._sliders
    for method, entry in ESTIMATORS.items():
        # orders that are words have no slider
        if entry.words:
            continue
        tab._estimator.value = WORDS[method]
        assert list(tab._sliders) == [*entry.orders, *entry.optional]
    choose(tab, "bj", 3, 2, 1, 4, 2)
    tab._choose.value = True
    assert not tab._sliders
    assert tab.request().words[3:] == ("--method", "bj")
    tab._choose.value = False
    assert tab.request().options["orders"] == (3, 2, 1, 4, 2)
    tab._estimator.value = WORDS["okid"]
    assert not tab._choose.visible
    assert tab.request().options["orders"] == (2, 5)


@pytest.mark.slow
def test_models_stand_side_by_side_until_they_are_removed(tab, page):
    station, client = page
    for method, orders in (("arx", (2, 2, 1)), ("oe", (2, 2, 1)), ("oe", (1, 2, 1))):
        choose(tab, method, *orders)
        press(tab._run)
    names = ["1: ARX 2/2/1", "2: OE 2/2/1", "3: OE 1/2/1"]
    assert [one.name for one in station.identified.listed.values()] == names
    assert len({one.style.colour for one in station.identified.listed.values()}) == 3
    bode = tab._cards["Bode"]
    assert bode.content == " ".join([*names, "truth", "published"])
    tab._shown[2].value = False
    tab._shown["truth"].value = False
    assert bode.content == "1: ARX 2/2/1 3: OE 1/2/1 published"
    tab._selected.value = names[0]
    assert "ARX from" in tab._cards["Numbers"].content
    again = IdentifyTab(station, client)  # as after a reload
    assert again._cards["Bode"].content == bode.content
    assert not again._shown[2].value and again._shown[3].value and not again._shown["truth"].value
    assert again._selected.value == names[0]
    act(again, "remove")
    assert list(station.identified.listed) == [2, 3]
    assert again._cards["Bode"].content == "3: OE 1/2/1 published"
    act(again, "remove")
    act(again, "remove")
    assert not again._results.visible
    assert station.identified.figures == {}


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("skip", "soon", "expected a number, given 'soon'"),
        ("skip", "-1", "expected 0 s or more, given -1"),
        ("skip", "40", "expected less than the 40 s of the record"),
        ("skip", "nan", "expected 0 s or more, given nan"),
        ("steps", "0", "expected 1 sample or more, given 0"),
        ("steps", "2.5", "expected a whole number, given '2.5'"),
        ("input", " , ", "expected the name of a column"),
        ("dt", "fast", "expected a number or nothing, given 'fast'"),
        ("dt", "0", "expected more than 0 s, given 0 s"),
        ("file", "/no/such.csv", "there is no file '/no/such.csv'"),
        ("file", "/dev/zero", "'/dev/zero' is neither a file nor a folder"),
        ("other", "none.nc", "there is no file 'none.nc'"),
    ],
)
def test_a_wrong_field_says_what_is_wrong(tab, page, field, value, expected):
    fill(tab, **{field: value})
    assert expected in message(tab, field)
    assert not any(message(tab, name) for name in tab._form.handles if name != field)
    press(tab._run)
    assert "a field is wrong" in page[1].notices[-1]


def test_what_cannot_be_identified_is_told_and_the_page_goes_on(tab, page, log, tmp_path):
    station, client = page
    fill(tab, record=FILE)
    press(tab._run)
    assert "type the path of a file" in client.notices[-1]
    (tmp_path / "flat.csv").write_text("t,u,y\n" + "".join(f"{0.02 * k},1,{k % 7}\n" for k in range(600)))
    fill(tab, file=str(tmp_path / "flat.csv"), validate=FILE)
    press(tab._run)
    assert "the file that judges" in client.notices[-1]
    fill(tab, validate="its last quarter")
    choose(tab, "arx", 2, 2, 1)
    press(tab._run)
    assert "the input 'u' is constant" in tab._state.text
    fill(tab, record=log.name)
    press(tab._run)
    assert tab._state.text == ""
    assert tab._results.visible
    station.session.keep(
        replace(log, name="task", axes=("x", "y", "z"), volts=np.zeros((len(log), 3)), counts=np.zeros((len(log), 3)))
    )
    assert tab._form.handles["record"].value == "task"
    press(tab._run)
    assert "a field is wrong" in client.notices[-1]
    assert "task moves x, y, z: choose the joint" in "".join(message(tab, name) for name in tab._form.handles)


def test_a_table_from_elsewhere_and_another_record_that_judges(tab, page, tmp_path):
    station, _ = page
    assert not tab._form.folders[COLUMNS].visible
    rng = np.random.default_rng(0)
    for name in ("robot", "other"):
        u, y = rng.standard_normal(400), np.zeros(400)
        for k in range(1, 400):
            y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
        y += 0.01 * rng.standard_normal(400)
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack((u, y)), delimiter=",", header="torque,angle", comments="")
    fill(tab, record=FILE, file=str(tmp_path / "robot.csv"), validate=FILE, other=str(tmp_path / "other.csv"))
    assert tab._form.folders[COLUMNS].visible
    fill(tab, input="torque", output="angle", dt="0.02", keep_mean=True)
    choose(tab, "oe", 1, 1, 1)
    press(tab._run)
    (model,) = station.identified.listed.values()
    assert model.found.result.fitted.estimate.poles()[0].real == pytest.approx(0.9, abs=0.02)
    assert "fits to other.csv" in model.found.title
    assert model.known == model.remarks == ()
    options = dict(zip(model.request.words[3::2], model.request.words[4::2], strict=False))
    assert (options["--input"], options["--output"], options["--dt"]) == ("torque", "angle", "0.02")


def test_a_record_becomes_a_file_once_and_spares_other_files(tab, page, log, tmp_path):
    session = page[0].session
    (tmp_path / f"{log.name}.nc").write_text("mine")
    path = session.file_of(log.name)
    assert path.name == f"{log.name}-2.nc"
    assert session.file_of(log.name) == path
    assert (tmp_path / f"{log.name}.nc").read_text() == "mine"


def test_work_that_waits_begins_when_the_other_has_ended(page):
    work, order = page[0].work, []
    work.start("first", time.sleep, 0.5, done=lambda _: order.append("first"), failed=order.append)
    for name in ("old", "new"):
        work.when_free("drawing", lambda name=name: order.append(name))
    wait_until(lambda: len(order) == 2)
    assert order == ["first", "new"]
    work.when_free("drawing", lambda: order.append("at once"))
    assert order[-1] == "at once"


@pytest.mark.thorough
def test_identified_and_drawn_beside_the_page_and_stopped(page, log, tmp_path, monkeypatch):
    station, client = page
    monkeypatch.setattr(station.session, "folder", tmp_path)
    monkeypatch.setattr(station, "identified", IdentifiedModels(station.work, station.session.tell))
    station.session.keep(log)
    tab = IdentifyTab(station, client)
    choose(tab, "oe", 2, 2, 1)
    press(tab._run)
    assert tab._stop.visible and not tab._run.visible
    wait_until(lambda: tab._cards["Fit"].content)
    assert not tab._stop.visible and tab._run.visible
    for name in FIGURES:
        assert tab._cards[name].content.count("<svg") == (2 if name == "Poles and zeros" else 1)
        assert "1: OE 2/2/1" in tab._cards[name].content
    tab._estimator.value = CHOICE
    press(tab._run)
    press(tab._stop)
    wait_until(lambda: "the identification was stopped" in tab._state.text)
    assert len(station.identified.listed) == 1

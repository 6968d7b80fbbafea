"""`hmtb identify` for anyone's data: every estimator, several channels, gaps, any table, its operating point."""

import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat
from scipy.signal import lfilter

from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.order_choice import choose_and_identify
from scenarios.identification.result_tables import roots_text
from sysid import IOData, StateSpace, SysidError, arx, compare, n4sid, oe, read_model
from sysid.models.static_gain import gain_at_zero
from sysid.polynomial.fit_with_offset import fit_with_offset, unexplained_offset
from sysid.records.errors import Message
from tests.scenarios.commands.conftest import DT, signals, table

ORDERS = {
    "arx": "1 1",
    "armax": "1 1 1",
    "oe": "1 1",
    "bj": "1 1 1 1",
    "iv4": "1 1",
    "okid": "1 4",
    "n4sid": "1",
    "pem_ss": "1",
    "tfest": "1 0 0",
    "procest": "P1",
    "impulseest": "150",
}


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_no_unit_makes_a_path_integrate(scale):
    lag = StateSpace([[0.9999]], [[1.0]], [[0.0001 * scale]], [[0.0]], None, dt=DT)
    np.testing.assert_allclose(gain_at_zero(lag, DT), scale, rtol=1e-9)
    integrator = StateSpace([[1.0 - 1e-13]], [[1.0]], [[0.0001 * scale]], [[0.0]], None, dt=DT)
    assert np.isnan(gain_at_zero(integrator, DT))
    # 10 is the state for an input of one
    difference = StateSpace([[0.9]], [[1.0]], [[-0.1 * scale]], [[scale]], None, dt=DT)
    assert gain_at_zero(difference, DT) == 0.0


@pytest.mark.parametrize(
    ("unit", "text"), [(1e-12, r"9\.9\d+e-13|1(\.0\d+)?e-12"), (1e12, r"9\.9\d+e\+11|1(\.0\d+)?e\+12")]
)
def test_gains_of_unlike_units_have_digits(printed, tmp_path, unit, text):
    u, y = signals()
    path = table(tmp_path / "units.csv", {"u": u, "y": unit * y})
    output = printed("identify", path, "--dt", DT, "--method", "oe", "--orders", 1, 1)
    assert re.search(rf"gain at 0 Hz\s+({text})\s", output)


@pytest.mark.slow
@pytest.mark.parametrize("method", ESTIMATORS)
def test_every_estimator_finds_the_pole(result, csv, method):
    output = result("identify", csv, "--method", method, "--orders", *ORDERS[method].split())
    if method == "impulseest":
        assert output["poles"] == []
        assert output["parameters"]["b3"] == pytest.approx(0.1 * 0.9**2, abs=0.02)
    else:
        (pole,) = output["poles"]  # from input to output: that of a noise model is not among them
        assert pole == pytest.approx([0.9, 0.0], abs=0.03)
    assert output["method"] == method
    given = [int(word) if word.isdigit() else word for word in ORDERS[method].split()]
    assert list(output["orders"].values())[: len(given)] == given
    assert set(output["fit"]) == {"simulation", "one_step", "steps", "ahead"}
    assert output["bandwidth_hz"] == pytest.approx(0.84, rel=0.3)
    if method != "n4sid":
        assert output["ci95"][0] < output["bandwidth_hz"] < output["ci95"][1]
    assert len(output["parameters"]) == len(output["deviations"])


def test_poles_are_printed_with_their_meaning(printed, csv):
    lines = printed("identify", csv, "--method", "oe", "--orders", "1", "1").splitlines()
    ((_, frequency, damping, time),) = [line.split() for line in lines if line.strip().startswith("0.9")]
    assert (float(frequency), damping) == (pytest.approx(0.84, rel=0.05), "1")
    assert float(time) == pytest.approx(0.19, rel=0.05)
    assert roots_text(np.array([0.5 + 0.25j, 0.5 - 0.25j, 0.0, 0.0])) == "0.5000 ± 0.2500j, 0 (2 times)"


@pytest.mark.slow
@pytest.mark.parametrize("method", ESTIMATORS)
def test_a_noise_free_start_from_rest_is_explained_whole(result, tmp_path, method):
    """From rest to another level: the mean of the output is not its level at the mean of the input."""
    # Without any noise the offset and the mode are canonical variates of equal rank: rounding would choose.
    u, noise = signals()[0], 1e-5 * np.random.default_rng(1).standard_normal(1200)
    y = lfilter([0, 0.1], [1, -0.9], u + 1.5) + (noise if method == "n4sid" else 0.0)
    path = table(tmp_path / "rest.csv", {"dt": np.full(len(u), DT), "u": u + 1.5, "y": y})
    output = result("identify", path, "--method", method, "--orders", *ORDERS[method].split())
    assert f"{output['fit']['simulation'][0]:.2f}" == "100.00"
    assert output["dc_gain"] == pytest.approx(1.0, abs=1e-4)
    at = output["operating_point"]
    # gain one, nothing else; a subspace method does not minimise the errors that the level is found from
    assert at["output"][0] == pytest.approx(at["input"][0], abs=5e-3 if method == "n4sid" else 1e-4)


@pytest.mark.slow
def test_method_and_orders_are_chosen_and_judged_on_the_last_quarter(result, printed, tmp_path):
    """The record starts from rest, away from the operating point: the offset is no dynamics."""
    rng = np.random.default_rng(4)
    u = 1.5 + rng.standard_normal(1600)
    y = lfilter([0, 0, 0.1], [1, -0.9], u) + 0.02 * rng.standard_normal(1600)
    path = table(tmp_path / "auto.csv", {"t": DT * np.arange(len(u)), "u": u, "y": y})
    output = result("identify", path)
    assert (output["method"], output["orders"]) == ("oe", {"nb": 1, "nf": 1, "nk": 2})
    assert output["samples"] == 1600 and output["choice"]["candidates"][0]["bic"] == 0.0
    assert output["fit"]["simulation"][0] > 90.0
    # the chosen orders are estimated from all samples, unless a part is held out explicitly
    whole = result("identify", path, "--method", "oe", "--orders", 1, 1, 2)
    assert output["dc_gain"] == pytest.approx(whole["dc_gain"], rel=1e-4)
    assert output["verdict"].startswith("sufficient") and output["held_out"] == 0.25
    assert "then estimated from all samples" in output["title"]
    assert output["estimated_from_all"] and "(part held out)" in printed("identify", path)
    held_out = result("identify", path, "--held-out", 0.25)
    assert not held_out["estimated_from_all"] and "the model is not estimated from them" in held_out["title"]
    assert held_out["samples"] == 1200 and held_out["dc_gain"] != pytest.approx(whole["dc_gain"], rel=1e-6)
    assert held_out["fit"]["simulation"] == pytest.approx(output["fit"]["simulation"])
    shown = printed("identify", path, "--method", "arx", "--validate", path)
    assert "ARX from auto.csv, fits to auto.csv" in shown and "Candidates, the best 8 of" in shown
    assert "sufficient" in next(line for line in shown.splitlines() if line.strip().startswith("verdict"))


def test_a_slow_disturbance_weights_the_errors_of_oe(result, printed, complaint, tmp_path):
    """A lag of gain 1 and bandwidth 0.84 Hz beside a slow sine of 30 % of its output."""
    rng = np.random.default_rng(12)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 4)
    y = lfilter([0, 0.1], [1, -0.9], u)
    sine = np.sin(2 * np.pi * 3.3 * np.arange(400) / 400 + 1.0) * np.sqrt(2.0)
    y = y + 0.3 * y.std() * (sine + 0.2 * rng.standard_normal(400))
    path = table(tmp_path / "sine.csv", {"t": DT * np.arange(400), "u": u, "y": y})
    output = result("identify", path, "--method", "oe")
    assert output["orders"]["nf"] == 1 and sum(output["weighting"]) >= 2
    assert output["dc_gain"] == pytest.approx(1.0, abs=0.05)
    assert output["bandwidth_hz"] == pytest.approx(0.839, abs=0.04)
    shown = printed("identify", path, "--method", "oe")
    assert "weighted by a model C/D of the disturbance" in shown
    # the command of the next line gives the same model
    _, _, *again = shlex.split(next(line for line in shown.splitlines() if line.startswith("next: ")))
    again[again.index("--save") + 1] = str(tmp_path / "sine.json")
    repeated = result(*again)
    assert repeated["weighting"] == output["weighting"]
    assert repeated["dc_gain"] == pytest.approx(output["dc_gain"], rel=1e-3)
    words = complaint("identify", path, "--method", "bj", "--orders", 1, 1, 1, 1, "--weighting", 1, 1)
    assert "--weighting 1 1 given with --method bj; expected --method oe" in words
    words = complaint("identify", path, "--weighting", 1, 1)
    assert "--weighting 1 1 given without --orders" in words
    words = complaint("identify", path, "--method", "oe", "--orders", 1, 1, "--weighting", 1)
    assert "expected two degrees NC ND" in words


@pytest.mark.parametrize("samples", [300, 20])
def test_orders_of_exact_and_of_short_records_are_chosen(samples):
    """Without noise, orders that are too high explain a wrong operating point by a pole at one."""
    u = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 75), 4)[:samples]
    result, choice = choose_and_identify([IOData(u, lfilter([0, 0.5, 0.3, 0.1], 1, u) + 7.0, DT)], "arx")
    if samples == 300:
        assert choice.candidates[0].orders == {"na": 0, "nb": 3, "nk": 1}
        assert result.fitted.estimate.dc_gain()[0, 0] == pytest.approx(0.9, rel=1e-9)
    assert ("chance decides" in choice.reason) == (samples == 20)


@pytest.mark.slow
def test_every_record_of_several_outputs_takes_part_in_the_choice():
    rng = np.random.default_rng(0)
    parts = []
    for samples in (150, 250):
        u = rng.standard_normal((samples, 1))
        y = lfilter([0, 0.5], [1, -0.8], u, axis=0) * [1.0, 2.0] + 0.1 * rng.standard_normal((samples, 2))
        parts.append(IOData(u, y, DT))
    assert choose_and_identify(parts, None)[1].samples > 250


def test_orders_are_chosen_for_polynomials_alone(complaint, csv):
    assert "--method okid needs --orders; they are chosen for arx, oe" in complaint("identify", csv, "--method", "okid")
    assert "unknown method 'armx': did you mean 'armax'" in complaint("identify", csv, "--method", "armx")


def test_the_level_never_costs_fit():
    u, y = signals(0.2, seed=5)
    for record in (IOData(u, y, DT), IOData(u, np.cumsum(y), DT)):
        plain = arx(record.detrend(), 2, 2, 1)
        estimate = fit_with_offset(lambda parts: arx(parts, 2, 2, 1), [record])
        assert estimate.estimate.loss <= plain.loss * (1 + 1e-9)


def test_an_estimator_that_fails_without_the_level_leaves_the_model_before():
    u, _ = signals(0.0)
    calls = []

    def once(parts):
        calls.append(parts)
        if len(calls) > 1:
            raise SysidError("no")
        return oe(parts, 1, 1, 1)

    estimate = fit_with_offset(once, [IOData(u + 2, lfilter([0, 0.1], [1, -0.9], u + 2), DT)])
    assert len(calls) == 2
    assert estimate.estimate.method == "oe"


def test_a_constant_over_several_parts_with_gaps_and_windows():
    u, y = signals(0.0)
    model = oe(IOData(u, y, DT), 1, 1, 1).model
    lost = y + 3.0
    lost[50:60] = np.nan
    parts = [
        IOData(u[:500], np.r_[np.full(20, 99.0), lost[20:500]], DT, window=20, missing=True),
        IOData(u[500:], y[500:] + 3.0, DT),
    ]
    level, before, after = unexplained_offset(model, parts)
    assert level[0] == pytest.approx(3.0)
    assert after < 1e-12 * before


def test_the_offset_of_a_long_record_is_computed_in_blocks(monkeypatch):
    u, y = signals()
    record = IOData(u, np.column_stack((y + 3.0, 1.0 - y)), DT, window=20)
    model = n4sid(record, 1).model
    whole = np.hstack(unexplained_offset(model, [record, record[:90]]))
    monkeypatch.setattr(sys.modules[unexplained_offset.__module__], "BLOCK", 100)
    np.testing.assert_allclose(np.hstack(unexplained_offset(model, [record, record[:90]])), whole, rtol=1e-9)


def test_keep_mean_takes_the_values_as_they_are(result, csv):
    output = result("identify", csv, "--method", "oe", "--orders", "1", "1", "--keep-mean")
    assert output["operating_point"] is None


@pytest.fixture
def two(tmp_path):
    rng = np.random.default_rng(1)
    u = rng.standard_normal((1500, 2))
    first = lfilter([0, 0.1], [1, -0.9], u[:, 0]) + lfilter([0, 0.3], [1, -0.6], u[:, 1])
    second = lfilter([0, 0.2], [1, -0.6], u[:, 1])
    y = np.column_stack([first, second]) + 0.01 * rng.standard_normal((1500, 2))
    return table(
        tmp_path / "two.csv",
        {"t": DT * np.arange(1500), "left": u[:, 0], "right": u[:, 1], "elbow": y[:, 0], "wrist": y[:, 1]},
    )


def test_several_inputs(result, two):
    channels = ("--input", "left", "right", "--output", "elbow")
    output = result("identify", two, *channels, "--method", "oe", "--orders", "1", "1")
    assert (output["inputs"], output["outputs"]) == (["left", "right"], ["elbow"])
    assert sorted(pole[0] for pole in output["poles"]) == pytest.approx([0.6, 0.9], abs=0.02)
    assert np.shape(output["bandwidth_hz"]) == (1, 2)
    assert np.shape(output["ci95"]) == (1, 2, 2)
    np.testing.assert_allclose(output["dc_gain"], [[1.0, 0.75]], rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "orders"), [("okid", "2 6"), ("n4sid", "2"), ("pem_ss", "2")])
def test_several_outputs(result, printed, two, method, orders):
    channels = ("--input", "left", "right", "--output", "elbow", "wrist")
    words = (two, *channels, "--method", method, "--orders", *orders.split())
    output = result("identify", *words)
    np.testing.assert_allclose(output["dc_gain"], [[1.0, 0.75], [0.0, 0.5]], atol=0.06)
    assert len(output["fit"]["simulation"]) == 2
    shown = printed("identify", *words)
    assert "bandwidth (-3 dB), right → wrist" in shown
    assert "elbow" in next(line for line in shown.splitlines() if "fit in simulation" in line)


def test_methods_for_one_output_say_which_take_several(complaint, two):
    message = complaint(
        "identify", two, "--input", "left", "--output", "elbow", "wrist", "--method", "oe", "--orders", "1", "1"
    )
    assert "oe takes one output, given 2; for several there are: okid, n4sid, pem_ss" in message


def test_a_matrix_in_a_mat_file_is_several_inputs(result, tmp_path):
    u = np.random.default_rng(0).standard_normal((400, 2))
    y = lfilter([0, 0.1], [1, -0.9], u[:, 0]) + lfilter([0, 0.3], [1, -0.6], u[:, 1])
    savemat(tmp_path / "wide.mat", {"u": u, "y": y, "dt": DT})
    output = result("identify", tmp_path / "wide.mat", "--method", "oe", "--orders", "1", "1")
    assert output["inputs"] == ["u1", "u2"]
    assert output["fit"]["simulation"][0] > 99.99


@pytest.mark.slow
@pytest.mark.parametrize("method", ESTIMATORS)
def test_missing_outputs_are_declared(result, complaint, tmp_path, method):
    u, y = signals(samples=500)
    y[200:230] = np.nan
    y[np.random.default_rng(0).random(len(y)) < 0.02] = np.nan
    path = table(tmp_path / "gaps.csv", {"t": DT * np.arange(len(u)), "u": u, "y": y})
    words = (path, "--method", method, "--orders", *ORDERS[method].split())
    assert "--missing takes NaN or empty cells" in complaint("identify", *words)
    output = result("identify", *words, "--missing")
    if method != "impulseest":
        assert output["poles"][0][0] == pytest.approx(0.9, abs=0.03)
    assert output["dc_gain"] == pytest.approx(1.0, abs=0.1)
    assert "of 500 output samples are missing" in output["warnings"][0]
    assert output["fit"]["simulation"][0] > 90


@pytest.mark.parametrize(("ending", "delimiter"), [("dat", " "), ("txt", "\t"), ("data", ";"), ("", ",")])
def test_any_table_is_read(result, tmp_path, ending, delimiter):
    u, y = signals()
    path = table(tmp_path / f"robot.{ending}".rstrip("."), {"u": u, "y": y}, header=False, delimiter=delimiter)
    output = result("identify", path, "--dt", "0.05", "--method", "oe", "--orders", "1", "1")
    assert output["dt"] == 0.05
    assert output["poles"][0][0] == pytest.approx(0.9, abs=0.02)


def test_logs_with_stamps_of_any_name_are_experiments(result, printed, complaint, tmp_path):
    rng, paths = np.random.default_rng(2), [tmp_path / "run-1.csv", tmp_path / "run-2.csv"]
    for seed, path in enumerate(paths):
        u, y = signals(seed=seed)
        stamps = 1_767_225_600_000_000 + np.cumsum(np.full(1200, 20_000)) + rng.integers(-100, 100, 1200)
        keep = np.setdiff1d(np.arange(1200), np.arange(500, 540) if seed else [])
        table(path, {"ticker": stamps[keep], "u": u[keep], "y": y[keep]})
    words = (*paths, "--method", "oe", "--orders", "1", "1")
    output = result("identify", *words, "--time", "ticker", "--time-unit", "us")
    assert output["poles"][0][0] == pytest.approx(0.9, abs=0.01)
    assert (output["dt"], output["samples"]) == (0.02, 2360)
    assert "run-2.csv: 1 gap(s) above 2.5 intervals" in output["warnings"][0]
    text = printed("identify", *words)
    assert "OE from run-1.csv, run-2.csv" in text
    assert "warning: run-1.csv: times are column 'ticker', the only one that increases steadily; " in text
    assert "--time NAME" in complaint("identify", table(tmp_path / "bare.csv", {"u": u, "y": y}), *words[2:])
    assert "no column of times 'clk'" in complaint("identify", *words, "--time", "clk")
    assert result("compare", paths[1], "--models", "oe:1/1", "--time", "ticker")["samples"] == 1160


def test_a_bare_table_of_more_columns_says_how_to_name_them(result, complaint, tmp_path):
    u, y = signals()
    path = table(tmp_path / "bare.dat", {"a": u, "b": -u, "c": y}, header=False, delimiter=" ")
    words = (path, "--dt", "0.02", "--method", "arx", "--orders", "1", "1")
    message = complaint("identify", *words)
    assert "3 columns without a header" in message
    assert "u, y in this sequence, 2 in all; --input and --output name them, inputs first" in message
    named = (*words, "--input", "u", "idle", "--output", "y")
    assert result("identify", *named)["inputs"] == ["u", "idle"]


def test_plain_netcdf_is_read_by_its_variables(result, complaint, tmp_path):
    u, y = signals()
    stored = xr.Dataset({"torque": ("time", u), "angle": ("time", y)}, {"time": DT * np.arange(len(u))})
    stored["angle"].attrs["units"] = "rad"
    stored.to_netcdf(tmp_path / "robot.nc", engine="h5netcdf")
    method = ("--method", "oe", "--orders", "1", "1")
    output = result("identify", tmp_path / "robot.nc", "--input", "torque", "--output", "angle", *method)
    assert output["dt"] == pytest.approx(DT)
    assert output["poles"][0][0] == pytest.approx(0.9, abs=0.02)
    message = complaint("identify", tmp_path / "robot.nc", "--output", "angle", *method)
    assert "unknown column 'u'; choose by --input; there are" in message


def test_what_is_printed(result, printed, csv):
    words = (csv, "--method", "armax", "--orders", "1", "1", "1", "--steps", "5")
    lines = printed("identify", *words).splitlines()
    output = result("identify", *words)
    shown = {re.split(r"\s{2,}", line.strip())[0]: line for line in lines}
    assert f"{output['fit']['ahead'][0]:.2f} %" in shown["fit 5 steps ahead"]
    assert f"{output['fpe']:.4g}" == shown["final prediction error"].split()[-1]
    assert f"{output['aic']:.5g}, {output['bic']:.5g}" in shown["AIC, BIC (normalised, per sample)"]
    assert "yes (p = " in shown["residuals white"]
    assert "yes (p = " in shown["residuals independent of the input"]
    (line,) = (line for line in shown.values() if line.split()[:1] == ["a1"])
    assert line.split() == ["a1", f"{output['parameters']['a1']:.6g}", f"{output['deviations']['a1']:.2g}"]
    assert output["residuals"]["passed"]


def test_another_record_is_judged_about_its_own_level(result, tmp_path, csv):
    u, y = signals(seed=9)
    other = table(tmp_path / "other.csv", {"t": DT * np.arange(len(u)), "u": u + 2.0, "y": y + 2.0 + 5.0})
    words = ("--method", "oe", "--orders", "1", "1")
    own = result("identify", csv, *words, "--validate", csv)
    assert own["fit"] == result("identify", csv, *words)["fit"]
    apart = result("identify", csv, *words, "--validate", other)
    record = IOData(u, y, DT)
    model = oe(IOData(*signals(), DT), 1, 1, 1)
    assert apart["fit"]["simulation"][0] == pytest.approx(compare(model, record)[0].simulation[0], abs=0.05)


@pytest.mark.slow
def test_figures(result, tmp_path, csv, two):
    output = result("identify", csv, "--method", "oe", "--orders", "1", "1", "--out", tmp_path / "figures")
    names = ["record", "outputs", "bode", "step", "roots", "residuals"]
    assert output["figures"] == [str(tmp_path / "figures" / f"robot-{name}.png") for name in names]
    assert all(Path(path).stat().st_size > 5000 for path in output["figures"])
    channels = ("--input", "left", "right", "--output", "elbow", "wrist")
    assert output["report"] == str(tmp_path / "figures" / "report.html")
    several = result("identify", two, *channels, "--method", "n4sid", "--orders", "2", "--out", tmp_path / "several")
    assert len(several["figures"]) == 6
    # four paths, of which the reader chooses one
    page = Path(several["report"]).read_text(encoding="utf-8")
    assert all(f"{output} → {input}" in page for output in ("left", "right") for input in ("elbow", "wrist"))


def test_inputs_that_move_together_are_told_once(result, tmp_path):
    u, y = signals()
    other = signals(seed=1)[0]
    near = u + 1e-3 * np.random.default_rng(2).standard_normal(len(u))
    path = table(tmp_path / "two.csv", {"t": DT * np.arange(len(u)), "a": u, "b": near, "c": other, "y": y})
    words = (path, "--output", "y", "--method", "arx", "--orders", "1", "1")
    (outcome,) = (w for w in result("identify", *words, "--input", "a", "b")["warnings"] if "move together" in w)
    assert outcome.startswith("the inputs a, b move together (condition ")
    assert not any("move together" in w for w in result("identify", *words, "--input", "a", "c")["warnings"])


def test_what_holds_for_every_path_is_said_once_and_without_python(result, tmp_path):
    t = DT * np.arange(1200)
    u = np.column_stack([sum(np.sin(2 * np.pi * f * t + f) for f in tones) for tones in ((3, 5, 7), (3, 6, 8))])
    y = lfilter([0, 0.1], [1, -0.9], u, axis=0) + 0.01 * np.random.default_rng(0).standard_normal((1200, 2))
    path = table(tmp_path / "two.csv", {"t": t, "a": u[:, 0], "b": u[:, 1], "y": y[:, 0], "z": y[:, 1]})
    words = (path, "--input", "a", "b", "--output", "y", "z", "--method", "n4sid", "--orders", "2")
    warnings = result("identify", *words)["warnings"]
    assert sum("nothing below 3 Hz is excited" in text for text in warnings) == 1
    assert not any("→" in text for text in warnings if "nothing below 3 Hz is excited" in text)


def test_advice_in_words_of_python_is_left_out():
    from scenarios.identification.identification import without_python_advice

    text, advice = "the model is unstable: 1.1", "; stable=True forbids it"
    assert without_python_advice(Message(text + advice, "unstable-model", stable=advice)) == text


def test_a_saved_model_is_compared_and_holds_its_operating_point(result, csv, tmp_path):
    path = tmp_path / "new folder" / "lag.json"
    words = ("--method", "oe", "--orders", 1, 1)
    identified = result("identify", csv, *words, "--save", path)
    assert identified["model_file"] == str(path)
    model = read_model(path)
    u, y = model.operating_point
    assert identified["operating_point"] == {"input": u.tolist(), "output": y.tolist()}
    assert f"hmtb identify {csv} --method oe --orders 1 1 --save '{path}'" in path.read_text(encoding="utf-8")
    saved, fitted = result("compare", csv, "--models", path, "oe:1/1")["models"]
    assert (saved["model"], saved["kind"]) == ("lag", "file")
    for key in ("bandwidth_hz", "ci95", "dc_gain"):
        np.testing.assert_allclose(saved[key], fitted[key], rtol=1e-6)
    np.testing.assert_allclose(saved["fit"]["simulation"], fitted["fit"]["simulation"], atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lag.m", "lag.c", "lag.fmu"])
def test_other_formats_go_by_the_ending(result, csv, tmp_path, name):
    result("identify", csv, "--method", "arx", "--orders", 1, 1, "--save", tmp_path / name)
    assert (tmp_path / name).stat().st_size > 500


def test_files_of_models_that_cannot_be_are_refused(complaint, csv, tmp_path):
    words = ("identify", csv, "--method", "arx", "--orders", 1, 1)
    assert "expected a file that ends with .json, .m, .c, .fmu" in complaint(*words, "--save", tmp_path / "lag.mat")
    (tmp_path / "bad.json").write_text("{}", encoding="utf-8")
    assert "bad.json: no model file" in complaint("compare", csv, "--models", tmp_path / "bad.json")


def test_the_end_of_a_record_judges_when_asked(result, printed, complaint, csv):
    words = (csv, "--method", "oe", "--orders", 1, 1)
    half = result("identify", *words, "--held-out", 0.5)
    assert half["samples"] == 600
    assert half["fit"] != result("identify", *words)["fit"]
    shown = printed("identify", *words, "--held-out", 0.5)
    assert "fits to robot.csv 12 to 24 s, held out: the model is not estimated from them" in shown
    assert "from 0 to 0.9" in complaint("identify", *words, "--held-out", 1)
    assert "expected one: what judges" in complaint("identify", *words, "--held-out", 0.5, "--validate", csv)
    short = Path(csv).with_name("short.csv")
    short.write_text("\n".join(Path(csv).read_text().splitlines()[:301]))
    assert "300 samples in one piece" in complaint("identify", short, *words[1:], "--held-out", 0.5)


def test_a_gap_is_cut_also_where_outputs_may_be_missing(result, printed, tmp_path):
    """Inputs in a gap are not known: held ones would be invented. The last part judges and is named."""
    u, y = signals(samples=2000)
    keep = np.delete(np.arange(2000), np.s_[700:741])
    path = table(tmp_path / "joint.csv", {"t": DT * keep, "u": u[keep], "y": y[keep]})
    words = (path, "--method", "oe", "--orders", "1", "1")
    assert result("identify", *words, "--missing")["parameters"] == result("identify", *words)["parameters"]
    shown = printed("identify", *words, "--missing", "--held-out", "0.25")
    assert "OE from joint.csv, fits to joint.csv 33.7 to 40 s, held out" in shown
    assert "the model is of 2 parts" in shown and "the fits are" not in shown


@pytest.mark.parametrize(
    ("scale", "noise", "expected"),
    [
        (1.0, 0.01, "sufficient"),
        (1.0, 1.0, "undecided: .* below 50 %"),
        (-1.0, 0.01, "not sufficient: the sim"),
    ],
)
def test_the_verdict_needs_a_simulation_that_explains_the_output(printed, csv, tmp_path, scale, noise, expected):
    u, y = signals(noise, seed=5)
    other = table(tmp_path / "other.csv", {"t": DT * np.arange(len(u)), "u": u, "y": scale * y})
    shown = printed("identify", csv, "--method", "oe", "--orders", "1", "1", "--validate", other)
    assert re.search(rf"verdict +{expected}", shown)
    assert "tested on whitened residuals" in shown


@pytest.mark.parametrize("ending", ["m", "c"])
def test_no_next_command_after_source_code(printed, csv, tmp_path, ending):
    words = ("--method", "oe", "--orders", "1", "1", "--save", tmp_path / f"servo.{ending}")
    shown = printed("identify", csv, *words)
    assert "model: " in shown and "next:" not in shown


def test_the_next_command_repeats_orders_of_each_input(result, printed, tmp_path):
    """`--orders '(1, 1)' '(1, 1)' '(1, 2)'` was printed, and refused."""
    rng = np.random.default_rng(4)
    u = np.stack([np.repeat(rng.choice([-1.0, 1.0], 100), 8) for _ in range(2)])
    y = lfilter([0.0, 0.3], [1.0, -0.7], u[0]) + lfilter([0.0, 0.0, 0.0, 0.2], [1.0, -0.9], u[1])
    y = y + 0.03 * rng.standard_normal(800)
    path = table(tmp_path / "two.csv", {"t": DT * np.arange(800), "u": u[0], "v": u[1], "y": y})
    shown = printed("identify", path, "--input", "u", "v", "--method", "oe")
    _, _, *again = shlex.split(next(line for line in shown.splitlines() if line.startswith("next: ")))
    assert "1,3" in again
    again[again.index("--save") + 1] = str(tmp_path / "two.json")
    repeated = result(*again)
    assert repeated["orders"]["nk"] == [1, 3]
    np.testing.assert_allclose(repeated["dc_gain"], [[1.0, 2.0]], rtol=0.05)


def test_the_next_command_follows_the_verdict(printed, tmp_path):
    """It repeated the model that the verdict had just refused."""
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 20)
    y = lfilter([0.0, 0.3], [1.0, -0.7], u) + 0.03 * rng.standard_normal(1200) + 0.005 * np.arange(1200)
    drifting = table(tmp_path / "drift.csv", {"t": DT * np.arange(1200), "u": u, "y": y})
    shown = printed("identify", drifting, "--method", "procest")
    assert shown.endswith(f"next: hmtb identify {drifting} --method oe --trend\n")
    assert "verdict" in shown and "follows a straight line" in " ".join(shown.split())
    u = rng.standard_normal(1200)
    static = table(tmp_path / "static.csv", {"t": DT * np.arange(1200), "u": u, "y": 2.5 * u + 0.1 * y.std()})
    shown = printed("identify", static, "--direct")
    assert "--direct" not in shown.rpartition("next: ")[2]


def test_a_wrong_sample_is_named_by_the_verdict(printed, tmp_path):
    """One of 2,000: the verdict named nonlinearity, feedback, low orders and another delay."""
    rng = np.random.default_rng(6)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 20)
    y = lfilter([0.0, 0.3], [1.0, -0.7], u) + 0.03 * rng.standard_normal(2000)
    y[777] += 60.0
    path = table(tmp_path / "wrong.csv", {"t": DT * np.arange(2000), "u": u, "y": y})
    shown = " ".join(printed("identify", path, "--method", "oe", "--orders", 1, 1, 1).split())
    assert "empty their cells and add --missing" in shown


def test_a_response_that_is_cut_off_is_not_called_nonlinear(printed, tmp_path):
    rng = np.random.default_rng(7)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 40)
    pole = np.exp(-1.0 / 120.0)
    y = lfilter([0.0, 1.0 - pole], [1.0, -pole], u)
    y = y + 0.01 * y.std() * rng.standard_normal(2400)
    path = table(tmp_path / "slow.csv", {"t": DT * np.arange(2400), "u": u, "y": y})
    shown = " ".join(printed("identify", path, "--method", "impulseest", "--orders", 140).split())
    assert "not sufficient: the impulse response to u has not decayed after 140 coefficients: --orders with" in shown

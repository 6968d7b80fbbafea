"""What judges a chosen model, and what a verdict makes of few samples and coarse steps, on records of known truth."""

import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

from scenarios.files.errors import ScenarioError
from scenarios.identification.file_identification import identify_files
from scenarios.identification.result_tables import verdict

DT = 0.05
GAIN = 2.0


def written(path, u, y):
    columns = np.column_stack((DT * np.arange(len(u)), u, y))
    np.savetxt(path, columns, delimiter=",", header="t,u,y", comments="")
    return path


def held(rng, samples, hold):
    return np.repeat(rng.choice([-1.0, 1.0], -(-samples // hold)), hold)[:samples]


def lag(u):
    """Gain 2, time constant of 4.5 samples, two samples of delay."""
    return lfilter([0.0, 0.0, 0.4], [1.0, -0.8], u)


def identified(files, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return identify_files(files, **options)


@pytest.mark.parametrize("options", [{}, {"method": "oe", "orders": (1, 1, 2), "held_out": 0.25}])
def test_the_end_of_a_run_is_judged_about_the_level_of_that_run(tmp_path, options):
    """Three files with mean outputs 100, -50 and 7: the end of the longest judges the model."""
    rng = np.random.default_rng(6)
    files = []
    for k, (level, samples) in enumerate(((100.0, 600), (-50.0, 800), (7.0, 500))):
        u = held(rng, samples, 5)
        y = lag(u) + level + 0.05 * rng.standard_normal(samples)
        files.append(written(tmp_path / f"run{k}.csv", u + 0.1 * level, y))
    found = identified(files, **options)
    assert found.result.fit.simulation.item() > 90.0
    assert verdict(found.result).startswith("sufficient")
    assert found.result.fitted.estimate.dc_gain().item() == pytest.approx(GAIN, rel=0.03)


def test_a_step_late_in_the_record_takes_part_in_the_estimate(tmp_path):
    """Before the last quarter no input would move."""
    rng = np.random.default_rng(7)
    u = np.where(np.arange(600) < 480, 0.0, 1.0)
    path = written(tmp_path / "late.csv", u, lag(u) + 0.02 * rng.standard_normal(600))
    found = identified([path])
    assert found.held_out == 0.0
    assert any("nothing is held out" in warning for warning in found.warnings)
    assert found.result.fitted.estimate.dc_gain().item() == pytest.approx(GAIN, rel=0.03)


@pytest.mark.parametrize("ends", [(0.05, 8.0), (8.0, 0.05)])
def test_a_chirp_over_the_whole_record_is_not_judged_at_frequencies_of_its_end_alone(tmp_path, ends):
    rng = np.random.default_rng(12)
    t = DT * np.arange(1200)
    u = np.sin(2.0 * np.pi * (ends[0] * t + 0.5 * (ends[1] - ends[0]) * t**2 / t[-1]))
    y = lag(u)
    path = written(tmp_path / "chirp.csv", u, y + 0.05 * y.std() * rng.standard_normal(1200))
    found = identified([path])
    assert found.held_out == 0.0 and verdict(found.result).startswith("sufficient")
    assert any("at other frequencies than before" in warning for warning in found.warnings)
    assert found.result.fitted.estimate.dc_gain().item() == pytest.approx(GAIN, rel=0.03)
    # of 0.4/(1 - 0.8/q), by its half-power frequency
    assert found.result.fitted.claims[0][0].hz == pytest.approx(0.716, rel=0.05)
    asked = identified([path], held_out=0.25)
    assert asked.held_out == 0.25


def test_few_samples_for_each_parameter_are_not_sufficient(tmp_path):
    rng = np.random.default_rng(8)
    u = held(rng, 60, 4)
    path = written(tmp_path / "short.csv", u, lag(u) + 0.05 * rng.standard_normal(60))
    enough = identified([path], method="oe", orders=(1, 1, 2))
    assert verdict(enough.result).startswith("sufficient")
    too_many = identified([path], method="bj", orders=(2, 2, 2, 2, 2))
    assert "60 samples are few for 8 parameters, 80 or more would tell" in verdict(too_many.result)


@pytest.mark.parametrize(("step", "is_sufficient"), [(0.01, True), (0.5, False)])
def test_coarse_steps_of_an_encoder_are_not_explained_by_rounding(tmp_path, step, is_sufficient):
    """Steps of an eighth of the output's range give a first-order model of a second-order servo."""
    rng = np.random.default_rng(9)
    u = held(rng, 1500, 50)
    y = lfilter([0.0, 0.0, 0.02, 0.02], [1.0, -1.6, 0.62], u)
    path = written(tmp_path / "encoder.csv", u, step * np.round(y / step))
    found = identified([path])
    assert verdict(found.result).startswith("sufficient") == is_sufficient


def test_the_next_command_of_a_choice_never_loses_delays(tmp_path):
    """Known delays of a state-space model have no option: the choice itself gives them again."""
    rng = np.random.default_rng(10)
    u = np.column_stack((held(rng, 900, 5), held(rng, 900, 7)))
    first, second = lfilter([0.0] * 4 + [0.4], [1.0, -0.8], u[:, 0]), lfilter([0.0] * 6 + [0.3], [1.0, -0.7], u[:, 1])
    y = np.column_stack((first + second, first - second)) + 0.02 * rng.standard_normal((900, 2))
    path = tmp_path / "two.csv"
    columns = np.column_stack((DT * np.arange(900), u, y))
    np.savetxt(path, columns, delimiter=",", header="t,u1,u2,y1,y2", comments="")
    found = identified([path], input=("u1", "u2"), output=("y1", "y2"))
    best = found.choice.candidates[0]
    assert any(best.orders["nk"]) and tuple(found.result.fitted.orders["nk"]) == tuple(best.orders["nk"])
    assert found.chosen_options == {}
    np.testing.assert_allclose(found.result.fitted.estimate.dc_gain(), [[2.0, 1.0], [2.0, -1.0]], atol=0.05)


def test_a_short_record_says_that_nothing_is_held_out(tmp_path):
    rng = np.random.default_rng(14)
    u = held(rng, 300, 5)
    found = identified([written(tmp_path / "short.csv", u, lag(u) + 0.05 * rng.standard_normal(300))])
    (remark,) = [warning for warning in found.warnings if "nothing is held out" in warning]
    assert "because the longest piece has 300 samples of the 400 that are expected" in remark


def test_an_output_that_stays_in_the_last_quarter_judges_nothing(tmp_path):
    """Small commands at the end, within one step of a coarse encoder."""
    rng = np.random.default_rng(15)
    u = held(rng, 800, 10)
    u[560:] = 0.01 * u[560:]
    y = np.round((lag(u) + 0.02 * rng.standard_normal(800)) / 0.5) * 0.5
    y[600:] = 0.0
    found = identified([written(tmp_path / "stays.csv", u, y)])
    assert found.held_out == 0.0
    assert any("an output stays there" in warning for warning in found.warnings)


def test_a_record_that_judges_its_own_model_is_said(tmp_path):
    rng = np.random.default_rng(16)
    u = held(rng, 500, 5)
    path = written(tmp_path / "own.csv", u, lag(u) + 0.05 * rng.standard_normal(500))
    found = identified([path], method="oe", orders=(1, 1, 2), validate=path)
    assert any("is one that it was estimated from" in warning for warning in found.warnings)


def test_impulseest_has_no_offset(tmp_path):
    rng = np.random.default_rng(17)
    u = held(rng, 500, 5)
    path = written(tmp_path / "r.csv", u, lag(u))
    with pytest.raises(ScenarioError, match="impulseest has no offset; expected one of arx, oe"):
        identified([path], method="impulseest", offset=True)


def test_an_offset_that_the_errors_keep_is_no_nonlinearity(tmp_path):
    """Position of a motor about the mean of its input, which is a ramp of the output."""
    rng = np.random.default_rng(18)
    u = held(rng, 1500, 40) + 0.5 * (np.arange(1500) > 300)
    y = np.cumsum(lfilter([0.0, 2.0], [1.0, -0.8], u))
    path = written(tmp_path / "motor.csv", u, y + 0.05 * rng.standard_normal(1500))
    about_means = verdict(identified([path], method="oe", orders=(2, 2, 1)).result)
    assert about_means.startswith("not sufficient: the errors keep an offset of the output, about ")
    assert "--trend, estimates it" in about_means
    assert verdict(identified([path], method="oe", orders=(2, 2, 1), trend=True).result).startswith("sufficient")

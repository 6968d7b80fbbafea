"""Verdicts of `hmtb identify` on joints whose truth is known."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from scenarios.identification.identification import identify
from scenarios.identification.order_choice import choose_and_identify, hold_out
from scenarios.identification.result_tables import model_rows, verdict
from sysid import IOData, Polynomials
from sysid.models import innovations_form
from tests.benchmarks.misleading_records import KINDS
from tests.benchmarks.nonlinear_joints import joint, stiff_servo
from tests.sysid.models.test_repeated_errors import record as repeating_record


def identified(record, method=None):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        whole = (replace(record, name="record"),)
        to_estimate, check = hold_out(whole)
        result, _ = choose_and_identify(
            to_estimate, method, check=check, continued=True, whole=whole if check else None
        )
    return result


def held(rng, samples, hold):
    return np.repeat(rng.choice([-1.0, 0.0, 1.0], -(-samples // hold)), hold)[:samples]


@pytest.mark.parametrize(
    ("kind", "words", "advice"),
    [
        ("friction", "dry friction", "larger amplitude"),
        ("play", "play", "larger amplitude"),
        ("saturation", "saturation", "smaller amplitude"),
    ],
)
def test_a_nonlinear_joint_is_not_sufficiently_described(kind, words, advice):
    _, record = joint(np.random.default_rng([101, 0]), kind)
    result = identified(record)
    assert verdict(result).startswith(f"not sufficient: the output depends nonlinearly on the input, as with {words} (")
    assert advice in verdict(result)
    assert dict(model_rows(result))["residuals nonlinear in the input"].startswith(f"yes (like {words}, ")
    assert result.record()["nonlinearity"]["kind"] == [words]


def test_friction_that_commands_between_two_levels_hide_withholds_the_verdict():
    _, record = joint(np.random.default_rng([61, 33]), "friction")
    noise = np.random.default_rng(33).standard_normal(record.y.shape)
    result = identified(replace(record, y=record.y + 0.003 * record.y.std() * noise))
    assert not result.nonlinear
    assert verdict(result).startswith("undecided: a servo with dry friction describes the record far better")
    assert "a servo with dry friction" in dict(model_rows(result))["residuals nonlinear in the input"]
    assert result.record()["nonlinearity"]["hidden"] == ["dry friction"]


def test_a_linear_joint_is_sufficiently_described():
    _, record = joint(np.random.default_rng([101, 1]), "linear")
    result = identified(record)
    assert verdict(result).startswith("sufficient")
    assert dict(model_rows(result))["residuals nonlinear in the input"].startswith("no (p = ")
    assert result.record()["nonlinearity"]["seen"] == [False]
    assert result.fitted.estimate.dc_gain()[0, 0] == pytest.approx(1.0, abs=0.01)


def test_a_model_no_better_than_the_command_is_not_called_sufficient():
    """A drive that follows within a sample or two: nothing but the delay is seen in slow commands."""
    rng = np.random.default_rng(3)
    u = lfilter([1.0], [1.0, -1.9, 0.9025], rng.standard_normal(1600))
    u = u / u.std()
    late = np.concatenate((np.full(2, u[0]), u[:-2]))
    record = IOData(u, late + 0.05 * rng.standard_normal(1600), 0.01)
    result = identified(record)
    assert result.baseline.delays == (2,)
    assert not verdict(result).startswith("sufficient")
    assert dict(model_rows(result))["fit of the delayed command"].endswith("% (2 samples late)")


def test_a_model_without_bandwidth_is_not_sufficient_where_its_input_excites_slow_motions_alone():
    """A servo of 4.7 Hz under commands up to 1.3 Hz: the gain of the chosen model rises to 60 at Nyquist."""
    servo, record = stiff_servo(np.random.default_rng([91, 44]))
    result = identified(record)
    b, a = servo.discrete(record.dt)
    bandwidth = innovations_form(Polynomials(B=b, F=a), record.dt).bandwidth()[0, 0]
    (claim,) = result.fitted.claims[0]
    is_right = claim.hz == pytest.approx(bandwidth, rel=0.2)
    assert is_right or verdict(result).startswith("undecided: the bandwidth is not determined")


@pytest.mark.parametrize("method", [None, "tfest", "procest"])
def test_an_integrator_has_neither_gain_nor_operating_point(method):
    """A motor whose encoder starts at 4,000,000 counts: the verdict is that of its simulation."""
    rng = np.random.default_rng(3)
    u = held(rng, 4000, 20) + 0.05
    speed = lfilter([0.0, 80.0], [1.0, -0.98], u)
    record = IOData(u, np.round(4e6 + 0.1 * np.cumsum(speed)), 0.01)
    result = identified(record, method)
    rows = dict(model_rows(result))
    assert verdict(result).startswith("sufficient: ")
    assert rows["gain at 0 Hz"] == "none, it integrates"
    assert result.record()["dc_gain"] is None or np.isnan(result.record()["dc_gain"])
    assert rows.get("operating point", "y1 none, it integrates").endswith("y1 none, it integrates")
    assert float(rows["fit in simulation"].split(" %")[0]) > 99.0


def test_an_integrator_that_runs_away_on_the_part_held_out_leaves_but_rounding_of_its_own_records():
    """The slope is uncertain by a little: on the last quarter the errors exceed the rounding of the encoder."""
    plant, (record,) = KINDS["integrator"](np.random.default_rng([211, 4]))
    result = identified(record)
    assert plant.finds(result.fitted.estimate)
    assert not result.test.independent.all() and result.test.independence_p < 1e-4
    assert result.rounded == (True,)
    words = "sufficient from input to output: the residuals are no larger than the rounding of the output; "
    assert verdict(result).startswith(words)
    # errors that rounding does not explain still count
    step = np.diff(np.unique(record.y)).min()
    disturbed = record.y + 0.6 * step * np.sign(record.u)
    assert identified(replace(record, y=disturbed)).rounded == (False,)


def test_a_double_integrator_has_no_gain_either():
    """Torque to angle: the estimates of its two poles are a pair far from one, in the record's terms."""
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 15)
    y = lfilter([0.0, 5e-5, 5e-5], [1.0, -2.0, 1.0], u)
    result = identified(IOData(u, y + 0.02 * y.std() * rng.standard_normal(1500), 0.01))
    poles = result.fitted.estimate.poles()
    assert np.abs(poles - 1.0)[np.abs(poles) > 0.5].min() > 1.0 / 15000
    assert verdict(result).startswith("sufficient")
    assert dict(model_rows(result))["gain at 0 Hz"] == "none, it integrates"
    response = result.fitted.estimate.frequency_response(np.array([0.5, 2.0])).response.ravel()
    np.testing.assert_allclose(np.abs(response), 1.0 / (2.0 * np.pi * np.array([0.5, 2.0])) ** 2, rtol=0.05)


def test_the_fit_of_the_command_stands_beside_that_of_the_model():
    _, record = joint(np.random.default_rng([101, 1]), "linear")
    result = identified(record)
    (fit,) = result.baseline.fit
    judged = result.checked[0]
    y, u = judged.y[judged.window :, 0], judged.u[:, 0]
    late = u[judged.window - result.baseline.delays[0] : len(u) - result.baseline.delays[0]]
    assert fit == pytest.approx(100 * (1 - np.sqrt(np.mean((y - late) ** 2)) / y.std()))
    assert fit < result.fit.simulation[0]


def creeping(rng, samples=800, hold=50):
    """A lag of 10 samples, gain 1, and one of half the record, gain 0.35, beside 5 % noise."""
    u = np.repeat(rng.choice([-1.0, 1.0], samples // hold), hold)
    poles, gains = (0.9, np.exp(-2.0 / samples)), (1.0, 0.35)
    y = sum(lfilter([0.0, gain * (1.0 - pole)], [1.0, -pole], u) for pole, gain in zip(poles, gains, strict=True))
    return IOData(u, y + 0.05 * y.std() * rng.standard_normal(samples), 0.02)


@pytest.mark.parametrize("method", [None, "oe", "tfest", "procest", pytest.param("impulseest", marks=pytest.mark.slow)])
def test_a_slow_part_of_the_response_leaves_the_gain_open(method):
    """A model of the fast part alone has a gain 26 % too small and white residuals."""
    assert verdict(identified(creeping(np.random.default_rng([1, 7])), method)).startswith(("undecided", "not suff"))


def test_a_sufficient_verdict_says_how_large_a_slow_part_the_disturbance_may_hide():
    """Beside a random walk; a servo in little noise hides none."""
    _, (quiet,) = KINDS["linear joint"](np.random.default_rng([41, 0]))
    assert verdict(identified(quiet)).startswith("sufficient")
    assert verdict(identified(quiet)).endswith(" %")
    _, (record,) = KINDS["random walk"](np.random.default_rng([41, 1]))
    result = identified(record)
    (path,) = result.slow
    assert not path.is_shown
    share = path.possible_gain / result.fitted.gain[0, 0]
    assert share > 0.2
    # from there on such a lag changes the response by less than a fifth
    least = share / (0.2 * 2.0 * np.pi * 12.0)
    assert verdict(result).startswith(f"sufficient above {least:.2g} Hz")
    hidden = (
        "below that frequency the disturbance could hide a slow part of the response (time constant 12 s) of up to "
        f"{100 * share:.0f} % of the gain at 0 Hz"
    )
    assert verdict(result).partition("; simulated fit ")[2].partition("; ")[2].startswith(hidden)


def test_a_drift_that_a_model_of_given_orders_lacks_is_named():
    """Residual tests named nonlinearity and feedback."""
    rng = np.random.default_rng(1)
    u = held(rng, 1200, 20)
    y = lfilter([0.0, 0.3], [1.0, -0.8], u)
    records = [IOData(u, y + 0.03 * rng.standard_normal(1200) + slope * np.arange(1200), 0.02) for slope in (4e-3, 0.0)]
    for method, orders in (("oe", (1, 1, 1)), ("arx", (1, 1, 1)), ("tfest", (1, 0))):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            drifting, steady = (verdict(identify([record], method, orders)) for record in records)
        assert drifting.startswith("not sufficient") and "--trend" in drifting
        assert "--trend" not in steady


def lead_lag(u, noise, rng):
    """A divider with a direct term of 0.4 and a gain of 1 at 0 Hz."""
    y = lfilter([0.4, -0.3705], [1.0, -0.9512], u) / (0.0295 / 0.0488)
    return IOData(u, y + noise * y.std() * rng.standard_normal(len(u)), 0.001)


def test_a_direct_term_from_an_input_that_is_held_is_chosen():
    """No controller computes an input that stays the same from an output that moves."""
    rng = np.random.default_rng(1)
    result = identified(lead_lag(np.repeat(rng.uniform(-1.0, 1.0, 67), 30)[:2000], 0.01, rng))
    assert verdict(result).startswith("sufficient")
    assert result.fitted.orders["nk"] == 0
    assert result.fitted.gain[0, 0] == pytest.approx(1.0, rel=0.01)


def test_a_direct_term_is_tried_by_tfest_too():
    rng = np.random.default_rng(1)
    result = identified(lead_lag(np.repeat(rng.uniform(-1.0, 1.0, 67), 30)[:2000], 0.01, rng), "tfest")
    assert verdict(result).startswith("sufficient")
    assert result.fitted.gain[0, 0] == pytest.approx(1.0, rel=0.02)


def test_a_method_without_the_structure_is_not_sufficient_where_another_simulates_far_better():
    """Process models have three poles at most."""
    rng = np.random.default_rng(1)
    u = held(rng, 1500, 12)
    y = np.zeros(1500)
    for radius, angle in ((0.97, 0.1), (0.97, 0.35)):
        pole = radius * np.exp(1j * angle)
        denominator = np.poly([pole, pole.conj()]).real
        y += lfilter([0.0, denominator.sum()], denominator, u)
    result = identified(IOData(u, y + 0.02 * y.std() * rng.standard_normal(1500), 0.02), "procest")
    assert not verdict(result).startswith("sufficient")
    assert any("simulates far better" in caution for caution in result.cautions)


def test_beside_an_input_of_noise_the_verdict_names_the_option_for_a_direct_term():
    rng = np.random.default_rng(1)
    record = lead_lag(rng.standard_normal(2000), 0.01, rng)
    assert "--direct gives a model with a direct term" in verdict(identified(record))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asked, _ = choose_and_identify((replace(record, name="record"),), None, direct=True)
    assert verdict(asked).startswith("sufficient") and "--direct" not in verdict(asked)
    assert asked.fitted.gain[0, 0] == pytest.approx(1.0, rel=0.02)


def test_a_single_sine_is_not_sufficient():
    """Two parameters are all that it tells."""
    rng = np.random.default_rng(40)
    u = np.sin(2.0 * np.pi * 0.01 * np.arange(2000))
    y = lfilter([0.0, 0.0012, 0.0012], [1.0, -1.9584, 0.9608], u)
    result = identified(IOData(u, y + 0.02 * rng.standard_normal(2000), 0.01))
    assert not verdict(result).startswith("sufficient")


def test_inputs_that_move_together_are_told_in_the_verdict():
    rng = np.random.default_rng(5)
    u = held(rng, 900, 5)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 0.02 * rng.standard_normal(900)
    result = identified(IOData(np.column_stack((u, 2.0 * u + 1e-3 * rng.standard_normal(900))), y, 0.01))
    assert verdict(result).startswith("undecided: the inputs u1, u2 move together")


def test_a_residual_test_that_fails_by_chance_on_the_end_withholds_nothing():
    """p = 0.005 on the part held out and 0.78 on all samples, of a right model."""
    _, (record,) = KINDS["clean"](np.random.default_rng([121, 4]))
    result = identified(record)
    assert not result.test.independent.all() and result.by_chance.all()
    assert verdict(result).startswith("sufficient")
    row = dict(model_rows(result))["residuals independent of the input"]
    assert row.startswith("no (p = 0.005") and "; of all samples yes (p = 0.7" in row
    assert result.record()["residuals"]["independence_p_of_all_samples"][0, 0] > 0.5
    # one that fails for sure does not fail by chance
    sure = replace(result.test, independence_p=np.array([[1e-4]]))
    assert replace(result, test=sure).depends_on_input


def test_creep_under_smooth_commands_is_not_sufficient():
    """Minimum-jerk commands, a creep of a fifth of the gain over three records: the fast part alone fits 93 %."""
    rng = np.random.default_rng(115)
    samples = 1000
    knots = np.repeat(rng.uniform(-1.0, 1.0, samples // 100 + 1), 100)[: samples + 40]
    u = np.convolve(knots, np.hanning(41) / np.hanning(41).sum(), "valid")[:samples]
    poles, gains = (0.81, np.exp(-1.0 / (1.5 * samples))), (0.8, 0.4)
    y = sum(lfilter([0.0, gain * (1.0 - pole)], [1.0, -pole], u) for pole, gain in zip(poles, gains, strict=True))
    result = identified(IOData(u, y + 0.03 * y.std() * rng.standard_normal(samples), 0.02))
    gain = result.fitted.estimate.dc_gain()[0, 0]
    assert gain == pytest.approx(1.2, rel=0.2) or not verdict(result).startswith("sufficient")


@pytest.mark.parametrize("delay", [2, 4])
def test_a_lag_behind_a_delay_is_no_play(delay):
    """Its second-order servo describes it worse than one with play does."""
    for seed in range(100, 104):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 160), 5)
        y = lfilter([0.0] * delay + [0.1], [1.0, -0.9], u)
        result = identified(IOData(u, y + 0.01 * y.std() * rng.standard_normal(800), 0.02))
        assert result.nonlinearity.hidden == ("",)
        assert result.fitted.estimate.dc_gain()[0, 0] == pytest.approx(1.0, rel=0.02)


def test_a_delay_longer_than_the_long_model_is_no_nonlinearity():
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 15)
    y = lfilter([0.0] * 20 + [0.3], [1.0, -0.7], u)
    result = identified(IOData(u, y + 0.01 * y.std() * rng.standard_normal(900), 0.02))
    assert verdict(result).startswith("sufficient")
    assert result.fitted.orders["nk"] == 20


@pytest.mark.parametrize("share", [0.12, 0.2, 0.27])
@pytest.mark.parametrize("drift", [0.0, 0.3])
def test_a_clean_lag_of_a_quarter_of_its_record_is_told(share, drift):
    """It was withheld whatever the noise: the record holds no full period of its bandwidth."""
    pole, rng = np.exp(-1.0 / (800 * share)), np.random.default_rng(8)
    u = np.repeat(rng.uniform(-1.0, 1.0, 16), 50)
    y = lfilter([0.0, 1.0 - pole], [1.0, -pole], u)
    y = y + y.std() * (0.01 * rng.standard_normal(800) + drift * np.linspace(-1.0, 1.0, 800))
    result = identified(IOData(u, y, 0.05))
    assert verdict(result).startswith("sufficient")
    assert result.fitted.gain[0, 0] == pytest.approx(1.0, rel=0.1)
    assert result.fitted.claims[0][0].hz == pytest.approx(1.0 / (2.0 * np.pi * 40.0 * share), rel=0.1)


def test_gains_have_both_intervals_where_errors_repeat_with_the_command():
    data = repeating_record(0)
    result = identify([replace(data, name="record")], "oe", (2, 2, 1))
    rows = dict(model_rows(result))
    lowest = next(name for name in rows if name.startswith("gain at 0.25 Hz"))
    assert "by noise alone" in rows[lowest]
    assert "with distortion and order" in rows[lowest]
    assert "is the same in all 15 periods" in rows["errors of the simulation"]
    error = result.record()["model_error"]
    low, high = error["with_distortion_and_order"]
    assert (low <= error["gain"]).all()
    assert (error["gain"] <= high).all()
    assert (high - low > error["noise_alone"][1] - error["noise_alone"][0]).all()


def test_where_noise_explains_the_errors_no_gain_has_a_second_interval():
    data = repeating_record(0, cubic=0.0, noise=0.02)
    rows = dict(model_rows(identify([replace(data, name="record")], "oe", (2, 2, 1))))
    assert not any("with distortion and order" in text for text in rows.values())

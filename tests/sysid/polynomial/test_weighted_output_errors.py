"""Output-error models whose errors a model of the disturbance weights, on records of known truth."""

import warnings
from contextlib import contextmanager

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidError

DT, SAMPLES = 0.02, 400
TRUE_GAIN = 1.0


@contextmanager
def silent():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def record(seed, shape):
    """A lag of gain 1 beside a slow sine or coloured noise, 10 dB below its response."""
    rng = np.random.default_rng([77, seed])
    u = np.repeat(rng.choice([-1.0, 1.0], SAMPLES // 4), 4)
    response = lfilter([0.0, 0.1], [1.0, -0.9], u)
    if shape == "sine":
        disturbance = np.sqrt(2.0) * np.sin(2.0 * np.pi * 3.3 * np.arange(SAMPLES) / SAMPLES + rng.uniform(0.0, 6.0))
        disturbance += 0.2 * rng.standard_normal(SAMPLES)
    else:
        disturbance = lfilter([1.0], [1.0, -0.95], rng.standard_normal(SAMPLES + 200))[200:]
        disturbance /= disturbance.std()
    return IOData(u, response + 0.3 * response.std() * disturbance, DT).detrend()


@pytest.mark.parametrize(("shape", "weighting", "largest"), [("sine", (2, 2), 0.2), ("coloured", (0, 1), 0.85)])
def test_the_path_is_as_accurate_as_beside_a_noise_model(shape, weighting, largest):
    """Errors of the gain relative to those of equal weights; 95 % intervals hold the truth."""
    errors, held = [], []
    for seed in range(40):
        data = record(seed, shape)
        with silent():
            plain = sysid.oe(data, 1, 1, 1)
            weighted = sysid.oe(data, 1, 1, 1, weighting=weighting)
        errors.append([model.dc_gain().item() - TRUE_GAIN for model in (plain, weighted)])
        response = weighted.frequency_response([1e-3])
        deviation = np.sqrt(response.covariance[0, 0, 0, 0, 0])
        held.append(abs(errors[-1][1]) < 1.96 * deviation)
    of_plain, of_weighted = np.sqrt(np.mean(np.square(errors), axis=0))
    assert of_weighted < largest * of_plain
    # beside a sine, whose poles lie on the unit circle, they are too short, as those of bj: 0.78
    if shape == "coloured":
        # 3 standard deviations of 40 draws below 95 %
        assert np.mean(held) > 0.85


def test_it_is_the_path_of_box_jenkins_without_its_noise_model():
    data = record(0, "coloured")
    with silent():
        whole = sysid.bj(data, 1, 0, 1, 1, 1, offset=True)
        weighted = sysid.oe(data, 1, 1, 1, weighting=(0, 1), offset=True)
    assert weighted.method == "oe" and weighted.orders == {"nb": 1, "nf": 1, "nk": 1}
    assert weighted.parameter_names == ("b1", "f1")
    places = [whole.parameter_names.index(name) for name in weighted.parameter_names]
    assert (weighted.parameters == whole.parameters[places]).all()
    assert (weighted.covariance == whole.covariance[np.ix_(places, places)]).all()
    assert (weighted.model.gain == 0.0).all()
    # residuals are those of the simulation, about the constant that was estimated
    level = data.subtract(y=np.array(weighted.diagnostics["offsets"][0]))
    np.testing.assert_allclose(weighted.residuals[:, 0], sysid.resid(weighted, level).residuals[:, 0], atol=1e-12)


def test_minima_beside_each_other_at_the_edge_of_stability_are_told_apart():
    """Beside a slow sine C and D nearly cancel: which minimum a single search finds depends on the last digits."""
    rng = np.random.default_rng(12)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 4)
    y = lfilter([0, 0.1], [1, -0.9], u)
    sine = np.sin(2 * np.pi * 3.3 * np.arange(400) / 400 + 1.0) * np.sqrt(2.0)
    y = y + 0.3 * y.std() * (sine + 0.2 * rng.standard_normal(400))
    gains = []
    for seed in range(5):
        last_digits = 1e-9 * np.random.default_rng(seed).standard_normal(400)
        data = IOData(u, y + last_digits, 0.02).detrend()
        with silent():
            gains.append(sysid.oe(data, 2, 1, 1, weighting=(2, 2), offset=True).dc_gain()[0, 0])
    np.testing.assert_allclose(gains, gains[0], rtol=1e-5)


def test_inputs_of_their_own_orders_and_missing_outputs():
    rng = np.random.default_rng(3)
    u = rng.choice([-1.0, 1.0], (600, 2))
    y = lfilter([0.0, 0.5], [1.0, -0.8], u[:, 0]) + lfilter([0.0, 0.0, 0.4, 0.2], [1.0, -0.5], u[:, 1])
    y += lfilter([1.0], [1.0, -0.9], 0.2 * rng.standard_normal(600))
    y[rng.choice(600, 30, replace=False)] = np.nan
    with silent():
        model = sysid.oe(IOData(u, y, DT, missing=True), [1, 2], [1, 1], [1, 2], weighting=(0, 1))
    assert model.parameter_names == ("b1[1]", "b1[2]", "b2[2]", "f1[1]", "f1[2]")
    deviations = np.sqrt(np.diag(model.covariance))
    assert (np.abs(model.parameters - [0.5, 0.4, 0.2, -0.8, -0.5]) < 4.0 * deviations).all()
    assert (deviations < 0.05).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"weighting": 2}, "expected two degrees (nc, nd)"),
        ({"weighting": (1,)}, "expected two degrees (nc, nd)"),
        ({"weighting": "ab"}, "expected two degrees (nc, nd)"),
        ({"weighting": (1, -1)}, "weighting, nd must be a whole number"),
        ({"weighting": (1, 1), "focus": "simulation"}, "expected weighting=(0, 0)"),
    ],
)
def test_other_weightings_are_refused(options, words):
    with pytest.raises(SysidError) as caught:
        sysid.oe(record(0, "sine"), 1, 1, 1, **options)
    assert words in str(caught.value)


def test_a_frequency_response_has_no_disturbance_to_weight_by():
    response = sysid.spa(record(0, "sine"))
    with pytest.raises(SysidError, match="weighting"):
        sysid.oe(response, 1, 1, 1, weighting=(0, 1))


@pytest.mark.parametrize(("shape", "weighting"), [("sine", (2, 2)), ("coloured", (0, 1))])
def test_the_choice_of_oe_alone_weights_by_the_disturbance(shape, weighting):
    data = record(4, shape)
    with silent():
        choice = sysid.auto(data, methods=["oe"])
        again = sysid.oe(data, **choice.candidates[0].orders, **choice.candidates[0].trend_options, weighting=weighting)
    assert choice.candidates[0].orders == {"nb": 1, "nf": 1, "nk": 1}
    assert choice.candidates[0].weighting == weighting
    assert f"weighting={weighting[0]},{weighting[1]}" in choice.reason
    np.testing.assert_allclose(choice.estimate.parameters, again.parameters, rtol=1e-4)


def test_white_noise_needs_no_weighting():
    rng = np.random.default_rng(8)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 4)
    y = lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.1 * rng.standard_normal(400)
    with silent():
        choice = sysid.auto(IOData(u, y, DT).detrend(), methods=["oe"])
    assert choice.candidates[0].weighting == (0, 0)

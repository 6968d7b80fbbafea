import warnings

import numpy as np
import pytest

import sysid
from sysid import FrequencyResponse, IOData, SysidWarning
from tests.refusals import refused
from tests.sysid.systems import second_order

HZ = np.linspace(0.1, 5.0, 20)
G = 1.0 / (1.0 + 1j * HZ)
RECORD = second_order(0, 200, noise=0.1)
RAGGED = [[1, 2], [3]]
PILOT = sysid.arx(RECORD, 1, 1)


def of_data(response=G, **options):
    return FrequencyResponse.from_data(HZ, response, **options)


@pytest.mark.parametrize("many", [10**9, 2**70])
@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("n", sysid.idinput),
        ("inputs", lambda k: sysid.idinput(20, inputs=k)),
        ("periods", lambda k: sysid.idinput(20, periods=k)),
        ("samples", lambda k: sysid.design_input(PILOT, k, amplitude=1.0)),
        ("order", lambda k: sysid.vector_fit(of_data(), k)),
        ("nk", lambda k: sysid.fit_response(of_data(dt=0.1), 1, 1, k)),
        ("poles", lambda k: sysid.tfest(RECORD, k)),
    ],
)
def test_numbers_without_bound(name, call, many):
    refused(f"{name} must be a whole number from", call, many)


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("expected a FrequencyResponse", lambda: sysid.vector_fit(None, 2)),
        ("Polynomials to start", lambda: sysid.polyest(RECORD, 1, 1, 1, 0, 0, start=5)),
        ("frequencies: expected a list", lambda: sysid.spafdr(RECORD, frequencies=[])),
        ("dt must", lambda: sysid.read_csv(__file__, dt="0.02")),
        ("inputs by name", lambda: sysid.read_csv(__file__, inputs=None)),
        ("expected the paths", lambda: sysid.read_experiments(None)),
        ("response.*ragged", lambda: of_data(RAGGED)),
        ("variance.*ragged", lambda: of_data(variance=RAGGED)),
        ("covariance.*ragged", lambda: of_data(covariance=RAGGED)),
        (r"coherence: expected shape \(20, 1, 1\)", lambda: of_data(coherence=[1.0], averages=9)),
        ("dt must", lambda: of_data(dt=RAGGED)),
        ("dt must", lambda: of_data(dt=[])),
        ("averages belong", lambda: of_data(averages=9)),
        ("expected texts", lambda: of_data(input_names=[None])),
        ("change the unit", lambda: of_data(G * 1e200)),
        ("change the unit", lambda: of_data(G * 1e-200)),
        ("level must", lambda: sysid.feedback(RECORD, level=RAGGED)),
        ("max_delay must", lambda: sysid.tfest(RECORD, 1, max_delay=RAGGED)),
        ("nb must", lambda: sysid.polyest(RECORD, 1, b"x", 0, 0, 0)),
        ("nk must", lambda: sysid.two_stage(RECORD, 1, 1, b"x", RECORD.u)),
        ("delay is of continuous time", lambda: sysid.fit_response(of_data(dt=0.1), 1, 1, delay="x")),
        ("rbs does not take clock", lambda: sysid.idinput(20, clock=0)),
        ("rbs does not take register", lambda: sysid.idinput(20, register=[])),
        ("intersample must", lambda: sysid.d2c(PILOT, intersample=[])),
        ("zero at all frequencies", lambda: sysid.tfest(of_data(0.0 * G), 1, 0)),
        ("zero at all frequencies", lambda: sysid.tfest(of_data(np.stack((G, 0.0 * G), 1)[:, None]), 1, 0)),
        ("zero at all frequencies", lambda: sysid.fit_response_ss(of_data(0.0 * G), 2)),
    ],
)
def test_wrong_values_have_a_clear_message(message, call):
    refused(message, call)


def test_a_response_of_zero_has_a_vector_fit():
    assert not sysid.vector_fit(of_data(0.0 * G), 2).frequency_response(HZ).any()


def test_frequencies_without_power_do_not_stop_merge_and_vector_fit():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], (200, 2)), 2, axis=0)
    y = np.convolve(u.sum(axis=1), [0.0, 0.5, 0.3])[:400] + 0.1 * rng.standard_normal(400)
    response = sysid.spa(IOData(u, y, 0.1))
    known = np.isfinite(response.covariance).all(axis=(1, 2, 3, 4))
    assert not known.all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        merged = sysid.merge([response, response])
        fit = sysid.vector_fit(response, 2)
    np.testing.assert_allclose(merged.response[known], response.response[known], 1e-6)
    np.testing.assert_allclose(merged.covariance[known], 0.5 * response.covariance[known], 1e-6, 1e-15)
    assert np.isnan(merged.response[~known]).all()
    assert np.isfinite(fit.residues).all()


def test_an_exact_response_outweighs_others():
    merged = sysid.merge([of_data(variance=np.zeros(20)), of_data(2.0 * G, variance=np.ones(20))])
    np.testing.assert_allclose(merged.response[:, 0, 0], G, 1e-9)
    assert merged.covariance.max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_parameters_that_are_collinear_do_not_widen_the_response(seed):
    # a numerator b1 s + b0 and a delay are the same to first order where b1 is zero
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 200), 2)
    record = IOData(u, np.convolve(u, [0.0, 0.5, 0.3])[:400] + 0.1 * rng.standard_normal(400), 0.1)
    with pytest.warns(SysidWarning, match="determines 4 of 5"):
        model = sysid.tfest(sysid.etfe(record, smoothing=10), 2, 1, delay=None)
    deviations = model.frequency_response(np.linspace(0.1, 4.0, 9)).magnitude_deviation()
    assert deviations.max() < 0.1

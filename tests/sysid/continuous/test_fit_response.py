import pickle

import numpy as np
import pytest

import sysid
from sysid import FrequencyResponse, SysidWarning, fit_response, fit_response_ss
from tests.refusals import refused
from tests.sysid.systems import covered, multivariable, parameters_covered

HZ = np.geomspace(0.01, 1000.0, 60)
S = 2j * np.pi * HZ
B, A = [3.0, 50.0], [1.0, 2.0, 40.0, 60.0]
TRUE = np.polyval(B, S) / np.polyval(A, S)
DEVIATION = 0.05 * np.abs(TRUE)


def measured(seed, scale=1.0):
    rng = np.random.default_rng(seed)
    errors = DEVIATION * (rng.standard_normal((len(HZ), 2)) @ [np.sqrt(0.5), 1j * np.sqrt(0.5)])
    return FrequencyResponse.from_data(HZ, TRUE + errors, variance=scale * DEVIATION**2)


def test_recovers_a_transfer_function_and_its_delay_over_five_decades():
    exact = FrequencyResponse.from_data(HZ, TRUE * np.exp(-0.013 * S), variance=DEVIATION**2)
    fit = fit_response(exact, 2, 3, delay=None)
    np.testing.assert_allclose(fit.parameters, [*B, *A[1:], 0.013], rtol=1e-9)
    assert fit.parameter_names == ("b1", "b0", "a2", "a1", "a0", "Td")
    np.testing.assert_allclose(fit.continuous.delays, 0.013, rtol=1e-9)


@pytest.mark.parametrize(("nb", "nf", "nk"), [(2, 2, 1), (1, 3, 0), (4, 2, 2), (3, 0, 5)])
def test_recovers_discrete_time_models_and_their_delay_in_samples(nb, nf, nk):
    f = np.linspace(0.1, 4.9, 60)
    z = np.exp(0.2j * np.pi * f)
    b, a = np.random.default_rng(nb).standard_normal(nb), [1.0, -1.2, 0.6, -0.1][: nf + 1]
    g = z**-nk * np.polyval(b[::-1], 1 / z) / np.polyval(a[::-1], 1 / z)
    fit = fit_response(FrequencyResponse.from_data(f, g, dt=0.1), nb, nf, None)
    assert fit.orders["nk"] == nk
    np.testing.assert_allclose(fit.parameters, [*b, *a[1:]], atol=1e-9)
    np.testing.assert_allclose(fit.polynomials.B, [*np.zeros(nk), *b], atol=1e-9)


def test_transfer_functions_of_two_inputs_and_two_outputs_are_fitted_together():
    g = np.stack([np.stack([TRUE, 2.0 / (S + 3.0)], -1), np.stack([5.0 / (S + 9.0), (S + 1.0) / (S + 7.0)], -1)], 1)
    fit = sysid.tfest(FrequencyResponse.from_data(HZ, g), [[3, 1], [1, 1]], [[1, 0], [0, 1]])
    np.testing.assert_allclose(fit.continuous.frequency_response(HZ), g, rtol=1e-8)
    assert (fit.parameter_names[:2], fit.parameter_names[-1]) == (("b1[1,1]", "b0[1,1]"), "a0[2,2]")


@pytest.mark.parametrize("continuous", [False, True])
def test_recovers_state_space_models(continuous):
    truth = multivariable(poles=(0.95, 0.8, 0.3, -0.5))
    f = np.linspace(0.2, 24.0, 80)
    x, A = (2j * np.pi * f, 50.0 * (truth.A - np.eye(4))) if continuous else (np.exp(0.04j * np.pi * f), truth.A)
    g = truth.C @ np.linalg.inv(x[:, None, None] * np.eye(4) - A) @ truth.B + truth.D
    fit = fit_response_ss(FrequencyResponse.from_data(f, g, dt=0.0 if continuous else 0.02), 4)
    np.testing.assert_allclose(fit.frequency_response(f).response, g, atol=1e-10)
    np.testing.assert_allclose(np.sort_complex(fit.poles()), np.sort_complex(np.linalg.eigvals(A)), rtol=1e-8)


def test_a_model_linear_in_its_parameters_is_the_generalised_least_squares_estimate():
    rng, f = np.random.default_rng(0), np.linspace(0.5, 4.5, 20)
    z = np.exp(0.2j * np.pi * f)
    root = rng.standard_normal((20, 2, 2)) + 1j * rng.standard_normal((20, 2, 2))
    covariance = root @ root.conj().transpose(0, 2, 1)
    g = (root @ rng.standard_normal((20, 2, 2)) @ [[0.7], [0.7j]]).transpose(0, 2, 1)
    fit = fit_response(FrequencyResponse.from_data(f, g, dt=0.1, covariance=covariance), (1, 2), 0)
    columns = np.zeros((20, 2, 3), dtype=complex)
    columns[:, 0, 0], columns[:, 1, 1], columns[:, 1, 2] = 1 / z, 1 / z, 1 / z**2
    # a circular error of covariance S has the information 2 Re X* S^-1 X on real parameters
    weighted = np.linalg.solve(covariance, columns)
    information = 2 * np.einsum("fep,feq->pq", columns.conj(), weighted).real
    expected = np.linalg.solve(information, 2 * np.einsum("fep,fe->p", weighted.conj(), g[:, 0]).real)
    np.testing.assert_allclose(fit.parameters, expected, rtol=1e-8)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(information), rtol=1e-8)


def test_state_space_and_transfer_function_of_the_same_order_are_the_same_estimate():
    response = measured(0)
    states, fraction = fit_response_ss(response, 3), fit_response(response, 4, 3)
    squares = [fit.diagnostics["sum_of_squares"] for fit in (states, fraction)]
    np.testing.assert_allclose(*squares, rtol=1e-7)
    one, other = (fit.frequency_response(HZ).magnitude_deviation() for fit in (states, fraction))
    np.testing.assert_allclose(one, other, rtol=1e-3)


def test_intervals_do_not_depend_on_the_scale_of_the_covariance_where_that_is_unknown():
    fits = [fit_response(measured(0, scale), 2, 3, known_variance=False) for scale in (1.0, 100.0)]
    np.testing.assert_allclose(fits[0].parameters, fits[1].parameters, rtol=1e-6)
    np.testing.assert_allclose(fits[0].covariance, fits[1].covariance, rtol=1e-6)
    known = fit_response(measured(0, 100.0), 2, 3)
    np.testing.assert_allclose(
        np.diag(known.covariance) / np.diag(fit_response(measured(0), 2, 3).covariance), 100.0, rtol=1e-6
    )


@pytest.mark.thorough
def test_intervals_cover_the_truth_and_the_test_on_the_sum_of_squares_holds_its_level():
    fits = [fit_response(measured(seed), 2, 3) for seed in range(60)]
    inside = [parameters_covered(fit, [*B, *A[1:]]) for fit in fits]
    # five standard errors of 60 draws, even if the five parameters were one
    assert np.mean(inside) >= 0.95 - 5 * np.sqrt(0.95 * 0.05 / 60)
    assert np.mean([fit.diagnostics["p_value"] < 0.05 for fit in fits]) <= 0.05 + 5 * np.sqrt(0.05 * 0.95 / 60)
    damping = -np.roots(A)[0].real / np.abs(np.roots(A)[0])
    assert np.mean([covered(sysid.damp(fit).damping.ci95, damping)[-1] for fit in fits]) >= 0.84


def test_estimate_says_what_it_is_and_can_be_copied_and_saved(tmp_path):
    fit = fit_response(measured(0), 2, 3)
    assert "from 60 frequencies, 0.01 to 1000 Hz" in str(fit)
    assert "weighted sum of squares" in str(fit)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(fit)).continuous.poles(), fit.poles())
    assert fit.frequency_response(HZ).noise_spectrum is None
    f = np.linspace(0.1, 4.9, 40)
    sampled = FrequencyResponse.from_data(f, 1 / (np.exp(0.2j * np.pi * f) - 0.8), dt=0.1)
    saved = fit_response(sampled, 1, 1)
    copy = sysid.read_model(sysid.write_model(saved, tmp_path / "model.json"))
    np.testing.assert_array_equal(copy.realise(copy.parameters).A, saved.model.A)
    assert np.isnan(copy.noise_variance).all()


def test_warns_of_a_wrong_order_and_refuses_what_does_not_fit():
    with pytest.warns(SysidWarning, match="far above that expected"):
        fit_response(measured(0), 1, 1)
    two = FrequencyResponse.from_data(HZ[:5], np.ones((5, 2, 1)), dt=1e-4)
    refused("one output in discrete time", fit_response, two, 1, 1)
    refused("sampling interval", fit_response, measured(0), 1, 1, continuous=False)
    refused("nb must be a whole number from 1 to 4", fit_response, measured(0), 5, 3)
    refused("parameters from", fit_response, two.select(outputs=[0]), 6, 6)
    refused("parameters from", fit_response_ss, two.select(outputs=[0]), 6)
    refused("sysid.merge averages several", fit_response, [measured(0)], 2, 3)
    refused("delay must be", fit_response, measured(0), 2, 3, delay=-1.0)
    refused("covariance is zero", fit_response, FrequencyResponse.from_data(HZ, TRUE, variance=0 * HZ), 2, 3)

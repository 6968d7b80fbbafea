"""From numbers, and from what functions return, to a model: every form, and all that is refused."""

import control
import numpy as np
import pytest

import sysid
from scenarios.estimators.model_numbers import answer_of, unstable
from scenarios.estimators.outcome import Answer, NoModelError
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.task import Task
from sysid.models import innovations_form
from tests.refusals import refused

F = np.array([0.5, 2.0, 10.0])
OE = Task("oe", {"nb": 2, "nf": 2, "nk": 1}, 2, F)
NUM, DEN = [0.0, 0.2, 0.1], [1.0, -1.5, 0.7]
POLYNOMIALS = sysid.Polynomials(B=[0.0, 0.0, 0.2], F=[1.0, -0.8])
MODEL = innovations_form(POLYNOMIALS, 0.02)
SPREAD = np.tile(1e-4 * np.eye(2), (3, 1, 1))[:, None, None]
COVARIANCE = np.diag([1e-4, 2e-4])
ENDS = (np.array([[1.0]]), np.array([[2.0]]))
MATRICES = {"A": [[0.5]], "B": [[1.0]], "C": [[2.0]]}


def numbers(**values):
    return {name: np.array(value, dtype=float) for name, value in {"dt": 0.02, **values}.items()}


def record(nu=1, ny=1):
    rng = np.random.default_rng(1)
    return sysid.IOData(rng.standard_normal((50, nu)), rng.standard_normal((50, ny)), 0.02)


def test_all_forms_of_a_model_agree():
    z = np.exp(2j * np.pi * 0.02 * F)
    expected = np.polyval(NUM, z) / np.polyval(DEN, z)
    companion = innovations_form(sysid.Polynomials(B=NUM, F=DEN), 0.02)
    ways = [
        numbers(num=NUM, den=DEN),
        numbers(num=np.multiply(2.0, [NUM]).T, den=np.multiply(2.0, [DEN])),
        numbers(poly_b=NUM, poly_f=DEN),
        numbers(poly_a=DEN, poly_b=NUM, poly_c=[1.0, 0.3]),
        numbers(A=companion.A, B=companion.B.ravel(), C=companion.C.ravel(), D=0.0),
        numbers(A=companion.A, B=companion.B, C=companion.C, poly_b=NUM, poly_f=DEN),
    ]
    for way in ways:
        answer = answer_of(way, record(), OE)
        np.testing.assert_allclose(answer.model.frequency_response(F)[:, 0, 0], expected, rtol=1e-12)


def test_polynomials_of_several_inputs_with_their_covariance():
    """Inputs one after the other, zeros behind the shorter rows."""
    model = numbers(poly_b=[[0.0, 1.0, 0.5], [0.0, 0.0, 2.0]], poly_f=[[1.0, -0.5], [1.0, 0.0]], covariance=np.eye(4))
    answer = answer_of(model, record(2), Task("ss", {"order": 3}, 3, F))
    assert answer.response_covariance.shape == (3, 1, 2, 2, 2)
    # The second input has b1 alone: the response moves by exp(-2 i w) times its deviation.
    turn = np.exp(-4j * np.pi * 0.02 * F)
    expected = np.array([[turn.real**2, turn.real * turn.imag], [turn.real * turn.imag, turn.imag**2]])
    np.testing.assert_allclose(answer.response_covariance[:, 0, 1], np.moveaxis(expected, -1, 0), rtol=1e-6, atol=1e-9)


def test_covariance_of_response_and_bandwidth_follow_from_that_of_the_parameters():
    """They are those of an estimate of the toolbox with the same parameters and covariance."""
    rng = np.random.default_rng(5)
    u, e = rng.standard_normal((2, 400))
    model = innovations_form(sysid.Polynomials(B=NUM, F=DEN), 0.02)
    data = sysid.IOData(u, sysid.simulate(model, u)[:, 0] + 0.05 * e, 0.02)
    estimate = sysid.oe(data, 2, 2, 1)
    p = estimate.polynomials
    answer = answer_of(numbers(num=p.B, den=p.F, covariance=estimate.covariance), data, OE)
    claimed = estimate.frequency_response(F).covariance
    np.testing.assert_allclose(answer.response_covariance, claimed, rtol=1e-9, atol=1e-9 * claimed.max())
    np.testing.assert_allclose(answer.bandwidth_ci95, estimate.bandwidth().ci95, rtol=1e-9)


def test_zeros_among_the_parameters_are_parameters_where_the_orders_ask_for_them():
    """An estimate of 0 does not make a model of lower order of it."""
    model = numbers(poly_b=[0.0, 0.0, 0.1], poly_f=[1.0, -0.5, 0.0], covariance=np.eye(4))
    assert answer_of(model, record(), OE).covariance.shape == (4, 4)
    refused(r"expected one of 3 or 2 parameters", answer_of, model, record(), Task("ss", {"order": 2}, 2, F))


def test_zeros_that_fill_up_a_fraction_are_no_parameters():
    """A delay makes the numerator longer than the denominator."""
    num, den, covariance = [0.0, 0.0, 0.2, 0.1], [1.0, -1.5, 0.7, 0.0], np.diag([1.0, 4.0, 9.0, 16.0])
    for task in (Task("oe", {"nb": 2, "nf": 2, "nk": 2}, 2, F), Task("ss", {"order": 3}, 3, F)):
        answer = answer_of(numbers(num=num, den=den, covariance=covariance), record(), task)
        full = np.diag([1.0, 4.0, 9.0, 16.0, 0.0])
        padded = answer_of(numbers(num=num, den=den, covariance=full), record(), Task("ss", {"order": 3}, 3, F))
        np.testing.assert_allclose(answer.response_covariance, padded.response_covariance, rtol=1e-9)


def test_poles_of_the_noise_and_of_states_apart_do_not_make_a_model_unstable():
    stable = numbers(poly_b=[0.0, 1.0], poly_f=[1.0, -0.5], poly_d=[1.0, -1.2])
    assert not unstable(answer_of(stable, record(), OE).model)
    on_the_circle = numbers(poly_b=[0.0, 1.0], poly_f=[1.0, -1.0])
    assert "1 of 1 poles" in unstable(answer_of(on_the_circle, record(), OE).model)


@pytest.mark.parametrize(
    ("given", "kind", "why"),
    [
        ({}, "malformed", "dt given, expected dt and either A, B, C"),
        ({"A": [[1.0]], "num": NUM, "den": DEN}, "malformed", "A, den, dt, num given"),
        ({**MATRICES, "num": NUM, "den": DEN}, "malformed", "expected dt and either"),
        ({**MATRICES, "poly_a": [1.0]}, "malformed", "expected dt and either"),
        ({**MATRICES, "dt": [0.02, 0.02]}, "malformed", "no sampling time given"),
        ({**MATRICES, "dt": 1.0}, "malformed", "dt = 1 given"),
        ({**MATRICES, "dt": 0.0}, "malformed", "dt = 0 given, expected a discrete-time model"),
        ({**MATRICES, "dt": np.nan}, "not_finite", "dt has 1 of 1"),
        ({**MATRICES, "B": [[1.0, 2.0]]}, "malformed", r"B of shape (1, 2) given, expected (1, 1)"),
        ({**MATRICES, "A": np.eye(2), "B": [[1.0, 1.0]]}, "malformed", r"B of shape (1, 2) given, expected (2, 1)"),
        ({**MATRICES, "A": np.eye(101)}, "malformed", "at most 100 states"),
        ({"dt": 0.02, "num": np.ones(102), "den": np.eye(1, 102)[0]}, "malformed", "num of shape (102,) given"),
        ({**MATRICES, "B": [[np.inf]]}, "not_finite", "B has 1 of 1"),
        ({**MATRICES, "B": [[1e70]]}, "malformed", "numbers above 1e+60"),
        ({**MATRICES, "B": [[1e50]], "C": [[1e50]]}, "not_finite", "whose response is"),
        ({**MATRICES, "covariance": [[1.0]]}, "malformed", "without polynomials"),
        ({**MATRICES, "innovation_covariance": -1.0}, "malformed", "innovation_covariance has a negative eigenvalue"),
        ({"num": [1.0], "den": DEN}, "malformed", "num with 1 and den with 3 coefficients"),
        ({"num": NUM, "den": [0.0, 1.0, 0.5]}, "malformed", "den begins with 0"),
        ({"num": NUM, "den": [1e-60, 1.0, 0.5]}, "model", ""),
        ({"num": np.eye(2), "den": DEN}, "malformed", "expected a row of coefficients"),
        ({"poly_b": [0.0, 1.0], "poly_f": [2.0, 1.0]}, "malformed", "F must begin with 1, got [2. 1.]"),
        ({"num": NUM, "den": DEN, "covariance": np.eye(3)}, "malformed", "expected one of 4 parameters"),
        ({"num": NUM, "den": DEN, "covariance": np.ones(4)}, "malformed", "covariance of shape (4,)"),
        ({"num": NUM, "den": DEN, "covariance": np.triu(np.ones((4, 4)))}, "malformed", "covariance is not symmetric"),
        ({**MATRICES, "response_covariance": np.ones((3, 2))}, "malformed", "expected (3, 1, 1, 2, 2)"),
        ({**MATRICES, "response_covariance": -SPREAD}, "malformed", "negative eigenvalue at 0.5 Hz from input 1 to"),
        ({**MATRICES, "bandwidth_ci95": [2.0, 1.0]}, "malformed", "0 <= lower <= upper"),
        ({**MATRICES, "bandwidth_ci95": [1.0, np.inf]}, "not_finite", "bandwidth_ci95"),
        ({**MATRICES, "bandwidth_ci95": [np.nan, np.nan]}, "model", ""),
    ],
)
def test_numbers_that_are_no_model(given, kind, why):
    if kind == "model":
        assert answer_of(numbers(**given), record(), OE).model.order > 0
        return
    with pytest.raises(NoModelError) as caught:
        answer_of(numbers(**given), record(), OE)
    assert (caught.value.kind, why in str(caught.value)) == (kind, True), str(caught.value)


def test_rounding_does_not_make_a_covariance_of_ours_one_no_more():
    """Parameters of very different size, known only together."""
    rng = np.random.default_rng(2)
    direction = rng.standard_normal(4)
    scale = np.array([1e-6, 1.0, 1e4, 1e-2])
    covariance = np.outer(scale, scale) * (np.outer(direction, direction) + 1e-15 * rng.standard_normal((4, 4)))
    answer = answer_of(numbers(num=NUM, den=DEN, covariance=covariance), record(), OE)
    np.testing.assert_array_equal(answer.covariance, covariance)


def returned(value, data, task):
    return answer_of(numbers_of(value, data, task), data, task)


@pytest.mark.parametrize(
    "value",
    [
        MODEL,
        POLYNOMIALS,
        Answer(MODEL),
        Answer(MODEL, POLYNOMIALS, COVARIANCE),
        control.tf([0.2], [1.0, -0.8, 0.0], 0.02),
        control.tf([0.4, 0.0], [2.0, -1.6, 0.0, 0.0], 0.02),
        MODEL.to_control(),
        (POLYNOMIALS, COVARIANCE),
        (POLYNOMIALS, COVARIANCE, ENDS),
        (MODEL, SPREAD),
        (MODEL, None, ENDS),
        (control.tf([0.2], [1.0, -0.8, 0.0], 0.02), np.diag([1e-4, 2e-4, 0.0])),
    ],
    ids=str,
)
def test_all_forms_are_the_same_model(value, data, task):
    got = returned(value, data, task)
    expected = MODEL.frequency_response(task.frequencies)
    np.testing.assert_allclose(got.model.frequency_response(task.frequencies), expected, rtol=1e-12)


def test_claims_go_along_and_before_those_that_follow(data, task):
    got = returned(Answer(MODEL, POLYNOMIALS, COVARIANCE, SPREAD, ENDS), data, task)
    np.testing.assert_array_equal(got.covariance, COVARIANCE)
    np.testing.assert_array_equal(got.response_covariance, SPREAD)
    np.testing.assert_array_equal(got.bandwidth_ci95, ENDS)
    np.testing.assert_array_equal(got.polynomials.B, POLYNOMIALS.B)
    assert returned((MODEL, SPREAD), data, task).covariance is None
    plain = numbers(num=NUM, den=DEN, covariance=np.eye(4), response_covariance=SPREAD[:, 0, 0], bandwidth_ci95=[1, 2])
    answer = answer_of(plain, record(), OE)
    np.testing.assert_array_equal(answer.response_covariance, SPREAD)
    np.testing.assert_array_equal(answer.bandwidth_ci95, ENDS)


@pytest.mark.parametrize("method", ["n4sid", "pem_ss", "okid"])
def test_estimates_claim_what_they_know(method, data, task):
    """`n4sid` knows no covariance; others' covariance of matrices is none of polynomials."""
    start = sysid.n4sid(data, 1)
    estimate = start
    if method != "n4sid":
        estimate = sysid.pem_ss(data, start) if method == "pem_ss" else sysid.okid(data, 1, p=3)
    got = returned(estimate, data, task)
    assert got.covariance is None and got.polynomials is None
    assert (got.response_covariance is None) == (method == "n4sid")
    assert (got.bandwidth_ci95 is None) == (method == "n4sid")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (None, "NoneType given, expected Answer, sysid.Estimate"),
        (np.eye(2), "ndarray given, expected Answer"),
        ((MODEL,), "a tuple of 1 given"),
        ((None, None), "NoneType given"),
        (control.tf([1.0], [1.0, 1.0]), "dt = 0 given"),
        (control.tf([1.0], [1.0, 0.5], True), "a system with dt = True given"),
        (control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), "dt = 0 given"),
        ((MODEL, "much"), "covariance of type <U4 given"),
        ((MODEL, [[1.0], [1.0, 2.0]]), "covariance of type list given"),
        ((MODEL, 1j * SPREAD), "covariance of type complex128 given"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_other_values_are_no_model(value, why, data, task):
    with pytest.raises(NoModelError) as caught:
        returned(value, data, task)
    assert caught.value.kind == "malformed" and why in str(caught.value), str(caught.value)


def test_fractions_of_several_channels(task):
    num = [[NUM, [1.0, 0.5]], [[0.5], [0.0]]]
    system = control.tf(num, [[DEN, [1.0, 0.0, 0.0]], [[1.0, -0.9, 0.0], [1.0]]], 0.02)
    model = returned(system, record(2, 2), task).model
    expected = system(np.exp(2j * np.pi * 0.02 * F))
    np.testing.assert_allclose(model.frequency_response(F), np.moveaxis(expected, -1, 0), rtol=1e-12, atol=1e-15)

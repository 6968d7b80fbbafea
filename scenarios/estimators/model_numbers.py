"""From named numbers to a checked model: the one path of every answer, from a function or from a file."""

import warnings
from typing import Any

import numpy as np

from scenarios.estimators.claims import (
    check_covariance,
    claimed_interval,
    claimed_response_covariance,
    known_parameters,
)
from scenarios.estimators.named_numbers import FRACTION, MATRICES, POLYNOMIALS, Numbers, row, shaped
from scenarios.estimators.outcome import Answer, NoModelError
from scenarios.estimators.task import Task
from sysid import IOData, Polynomials, StateSpace, SysidError, SysidWarning
from sysid.models import block_diagonal, innovations_form
from sysid.records.arrays import FloatArray

MOST_ORDER = 100
"""Most states of a model: measuring it has no time limit, and takes less than half a second then."""

MOST_PARAMETERS = 100
"""With more parameters nothing is propagated to the response and the bandwidth: it would take seconds."""

LARGEST = 1e60
"""Largest number of a model: products of a few such numbers are still finite."""

SAME_DT = 1e-6
"""Relative tolerance of the sampling interval, which programs may print with six digits."""

FORMS = (({"A", "B", "C"}, set(MATRICES)), (set(FRACTION), set(FRACTION)), ({"poly_b"}, set(POLYNOMIALS)))
"""Forms of a model, matrices, fraction and polynomials: the numbers that it needs, and those that it may have."""


def answer_of(numbers: Numbers, data: IOData, task: Task) -> Answer:
    """Check numbers and make a model of them.

    Args:
        numbers: By names of `named_numbers.NAMES`, as docs/estimator-protocol.md describes them.
        data: The record of the request.
        task: The task of the request.

    Returns:
        The model with its claims; the claims about response and bandwidth follow from that about the parameters.

    Raises:
        NoModelError: They are no model, `malformed` or `not_finite`.
    """
    _check_form(numbers)
    _check_values(numbers, data)
    innovation = numbers.get("innovation_covariance")
    if innovation is not None:
        innovation = shaped("innovation_covariance", innovation, (data.ny, data.ny))
        check_covariance("innovation_covariance", innovation)
    try:
        polynomials = _polynomials(numbers, data)
        if "A" in numbers:
            model = _state_space(numbers, data, innovation)
        elif polynomials is not None:
            model = innovations_form(polynomials, data.dt, innovation)
        else:
            model = _of_fractions(numbers, data)
    except SysidError as error:
        raise NoModelError(str(error)) from error
    if model.order > MOST_ORDER:
        raise NoModelError(f"a model of {model.order} states given, expected at most {MOST_ORDER}")
    if not unstable(model):
        with np.errstate(all="ignore"):
            size = np.abs(model.frequency_response(task.frequencies)).max(initial=0.0)
        # A comparison that NaN fails too.
        if not size <= LARGEST:
            raise NoModelError(f"a model whose response is {size:g} at some frequency of the task", "not_finite")
    return _with_claims(model, polynomials, numbers, data, task)


def _with_claims(
    model: StateSpace, polynomials: Polynomials | None, numbers: Numbers, data: IOData, task: Task
) -> Answer:
    """A model with its claims; those about response and bandwidth that are missing follow from the parameters'."""
    covariance, response_covariance, ci95 = None, None, None
    if "response_covariance" in numbers:
        response_covariance = claimed_response_covariance(numbers["response_covariance"], data, task)
    if "bandwidth_ci95" in numbers:
        ci95 = claimed_interval(numbers["bandwidth_ci95"], data)
    if "covariance" in numbers:
        estimate = known_parameters(numbers["covariance"], polynomials, model, data, task)
        covariance = estimate.covariance
        is_missing = response_covariance is None or ci95 is None
        if is_missing and not unstable(model) and 0 < len(estimate.parameters) <= MOST_PARAMETERS:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore", SysidWarning)
                response, bandwidth = estimate.response_and_bandwidth(task.frequencies)
            response_covariance = response.covariance if response_covariance is None else response_covariance
            ci95 = bandwidth.ci95 if ci95 is None else ci95
    return Answer(model, polynomials, covariance, response_covariance, ci95)


def unstable(model: StateSpace) -> str:
    """Why a model counts as unstable; empty where it does not.

    Only poles from input to output count: those of the noise model, and states without effect, may lie anywhere.
    """
    moduli = np.abs(model.input_path().poles())
    outside = moduli[moduli >= 1.0]
    where = "on or outside the unit circle, the largest at"
    return f"{len(outside)} of {len(moduli)} poles {where} {outside[0]:.6g}" if len(outside) else ""


def _check_form(numbers: Numbers) -> None:
    """Refuse what is not exactly one form of a model, or matrices with polynomials."""
    names = set(numbers)
    forms = [form for form, (_, allowed) in enumerate(FORMS) if names & allowed]
    if forms not in ([0], [1], [2], [0, 2]) or not all(names >= FORMS[form][0] for form in forms):
        raise NoModelError(
            f"{', '.join(sorted(names)) or 'nothing'} given, expected dt and either A, B, C (D, K), or num and den, or "
            "poly_b (with others of poly_a to poly_f; A, B, C may stand beside them)"
        )


def _check_values(numbers: Numbers, data: IOData) -> None:
    for name, values in numbers.items():
        # An interval that is NaN says that there is no bandwidth.
        bad = np.isinf(values) if name == "bandwidth_ci95" else ~np.isfinite(values)
        if bad.any():
            raise NoModelError(
                f"{name} has {int(bad.sum())} of {values.size} numbers that are not finite", "not_finite"
            )
        if (np.abs(values) > LARGEST).any():
            raise NoModelError(f"{name} has numbers above {LARGEST:g}")
        # Before a model of too many states is made.
        if name in (*POLYNOMIALS, *FRACTION) and max(values.shape, default=0) > MOST_ORDER + 1:
            raise NoModelError(f"{name} of shape {values.shape} given, expected at most {MOST_ORDER + 1} in a row")
    dt = numbers.get("dt")
    if dt is None or dt.size != 1:
        raise NoModelError(f"no sampling time given, expected dt = {data.dt:g}, s")
    if not abs(dt.item() - data.dt) <= SAME_DT * data.dt:
        raise NoModelError(
            f"dt = {dt.item():g} given, expected a discrete-time model with that of the record, {data.dt:g}"
        )


def _state_space(numbers: Numbers, data: IOData, innovation: FloatArray | None) -> StateSpace:
    a = numbers["A"]
    # A single number is a model of one state, an empty list one without states.
    n = len(np.atleast_1d(a)) if a.size else 0
    if n > MOST_ORDER:
        raise NoModelError(f"A of shape {a.shape} given, expected at most {MOST_ORDER} states")
    shapes = ((n, n), (n, data.nu), (data.ny, n), (data.ny, data.nu), (n, data.ny))
    matrices: dict[str, Any] = {"D": np.zeros((data.ny, data.nu)), "K": None}
    for name, shape in zip(MATRICES, shapes, strict=True):
        if name in numbers:
            matrices[name] = shaped(name, numbers[name], shape)
    return StateSpace(**matrices, dt=data.dt, innovation_covariance=innovation)


def _polynomials(numbers: Numbers, data: IOData) -> Polynomials | None:
    """The polynomials among the numbers; None where there are none. One fraction is an output-error model."""
    if "num" in numbers and (data.nu, data.ny) == (1, 1):
        return _output_error(*(row(name, numbers[name]) for name in FRACTION))
    if "poly_b" not in numbers:
        return None
    coefficients = {}
    for name, letter in POLYNOMIALS.items():
        if name in numbers:
            # Of several inputs B and F have a row each.
            is_matrix = data.nu > 1 and letter in "BF"
            coefficients[letter] = numbers[name] if is_matrix else row(name, numbers[name])
    polynomials = Polynomials(**coefficients)
    if (1, polynomials.nu) != (data.ny, data.nu):
        raise NoModelError(
            f"polynomials of 1 output(s) from {polynomials.nu} input(s) given, expected {data.ny} output(s) from "
            f"{data.nu} input(s)"
        )
    return polynomials


def _output_error(num: FloatArray, den: FloatArray) -> Polynomials:
    """Numerator and denominator of equal length, the denominator scaled to begin with 1."""
    if len(num) != len(den):
        raise NoModelError(
            f"num with {len(num)} and den with {len(den)} coefficients given, expected as many of both: filled up "
            "with zeros, powers of z and of 1/z mean the same"
        )
    if den[0] == 0.0:
        raise NoModelError("den begins with 0, expected the coefficient of its highest power of z")
    with np.errstate(over="ignore"):
        # The quotient of two allowed numbers may be infinite.
        num, den = num / den[0], den / den[0]
    if not (np.isfinite(num).all() and np.isfinite(den).all()):
        raise NoModelError(f"num and den divided by {den[0]:g}, the first of den, are not finite", "not_finite")
    return Polynomials(B=num, F=den)


def _of_fractions(numbers: Numbers, data: IOData) -> StateSpace:
    """The model of fractions (ny, nu, k), one for each pair of output and input, side by side."""
    num, den = (numbers[name] for name in FRACTION)
    for name, values in zip(FRACTION, (num, den), strict=True):
        if values.ndim != 3 or values.shape[:2] != (data.ny, data.nu):
            raise NoModelError(
                f"{name} of shape {values.shape} given, expected ({data.ny}, {data.nu}, number of coefficients)"
            )
    pairs = list(np.ndindex(data.ny, data.nu))
    fractions = []
    for i, j in pairs:
        fractions.append(innovations_form(_output_error(num[i, j], den[i, j]), data.dt))
    # All fractions side by side; `into` leads each input to its fractions, `out` adds those of each output.
    beside, (rows, columns) = block_diagonal(fractions), np.array(pairs).T
    into, out = np.eye(data.nu)[columns], np.eye(data.ny)[:, rows]
    return StateSpace(beside.A, beside.B @ into, out @ beside.C, out @ beside.D @ into, None, data.dt)

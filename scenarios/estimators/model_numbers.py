"""From named numbers to a checked model: the one path of every answer, from a function or from a file."""

import numpy as np

from scenarios.estimators.claims import (
    check_covariance,
    claimed_interval,
    claimed_response_covariance,
    known_parameters,
    response_and_interval,
)
from scenarios.estimators.named_numbers import FRACTION, MATRICES, NAMES, POLYNOMIALS, Numbers, row, shaped
from scenarios.estimators.outcome import Answer, NoModelError
from scenarios.estimators.task import Task
from sysid import IOData, Polynomials, StateSpace, SysidError
from sysid.models import innovations_form
from sysid.records.arrays import FloatArray

MOST_ORDER = 100
"""Most states of a model: measuring it has no time limit, and takes less than half a second then."""

LARGEST = 1e60
"""Largest number of a model: products of a few such numbers are still finite."""

SAME_DT = 1e-6
"""Relative tolerance of the sampling interval, which programs may print with six digits."""

FORMS = (
    ("matrices", set(MATRICES), {"A", "B", "C"}),
    ("fraction", set(FRACTION), {"num", "den"}),
    ("polynomials", set(POLYNOMIALS), {"poly_b"}),
)
"""Forms of a model: name, the numbers that it may have, those that it needs."""


def answer_of(numbers: Numbers, data: IOData, task: Task) -> Answer:
    """Check numbers and make a model of them.

    Args:
        numbers: By names of `NAMES`: `dt`, and A, B, C (D zero, K none where left out) or `num` and `den` or `poly_a`
            ... `poly_f`, or matrices and polynomials together; and the claims.
        data: The record of the request.
        task: The task of the request.

    Returns:
        The model with its claims; the claims about response and bandwidth follow from that about the parameters.

    Raises:
        NoModelError: They are no model, `malformed` or `not_finite`.
    """
    _check_names(numbers)
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
        raise NoModelError("malformed", str(error)) from error
    if model.order > MOST_ORDER:
        raise NoModelError("malformed", f"a model of {model.order} states given, expected at most {MOST_ORDER}")
    is_stable = not unstable(model)
    if is_stable:
        with np.errstate(all="ignore"):
            size = np.abs(model.frequency_response(task.frequencies)).max(initial=0.0)
        if not size <= LARGEST:
            raise NoModelError("not_finite", f"a model whose response is {size:g} at some frequency of the task")
    covariance, spread, ends = map(numbers.get, ("covariance", "response_covariance", "bandwidth_ci95"))
    response_covariance = None if spread is None else claimed_response_covariance(spread, data, task)
    ci95 = None if ends is None else claimed_interval(ends, data)
    if covariance is not None:
        estimate = known_parameters(covariance, polynomials, model, data, task)
        covariance = estimate.covariance
        if (response_covariance is None or ci95 is None) and is_stable:
            follows = response_and_interval(estimate, task)
            response_covariance = follows[0] if response_covariance is None else response_covariance
            ci95 = follows[1] if ci95 is None else ci95
    return Answer(model, polynomials, covariance, response_covariance, ci95)


def unstable(model: StateSpace) -> str:
    """Why a model counts as unstable; empty where it does not.

    Only poles from input to output count: those of the noise model, and states without effect, may lie anywhere.
    """
    poles = model.input_path().poles()
    outside = poles[np.abs(poles) >= 1.0]
    if not len(outside):
        return ""
    return (
        f"{len(outside)} of {len(poles)} poles on or outside the unit circle, the largest at {np.abs(outside[0]):.6g}"
    )


def _check_names(numbers: Numbers) -> None:
    """Refuse unknown names, and what is not exactly one form of a model, or matrices with polynomials."""
    names = set(numbers)
    if unknown := sorted(names - set(NAMES)):
        raise NoModelError("malformed", f"unknown {unknown[0]!r} given, expected some of {', '.join(NAMES)}")
    forms = [form for form, some, _ in FORMS if names & some]
    whole = all(names >= needed for _, some, needed in FORMS if names & some)
    if not whole or (len(forms) != 1 and forms != ["matrices", "polynomials"]):
        raise NoModelError(
            "malformed",
            f"{', '.join(sorted(names)) or 'nothing'} given, expected dt and either A, B, C (D, K), or num and den, or "
            "poly_b (with others of poly_a to poly_f; A, B, C may stand beside them)",
        )


def _check_values(numbers: Numbers, data: IOData) -> None:
    for name, values in numbers.items():
        # An interval that is NaN says that there is no bandwidth.
        bad = np.isinf(values) if name == "bandwidth_ci95" else ~np.isfinite(values)
        if bad.any():
            raise NoModelError(
                "not_finite", f"{name} has {int(bad.sum())} of {values.size} numbers that are not finite"
            )
        if (np.abs(values) > LARGEST).any():
            raise NoModelError("malformed", f"{name} has numbers above {LARGEST:g}")
        # Before a model of too many states is made.
        if name in (*POLYNOMIALS, *FRACTION) and max(values.shape, default=0) > MOST_ORDER + 1:
            raise NoModelError(
                "malformed", f"{name} of shape {values.shape} given, expected at most {MOST_ORDER + 1} in a row"
            )
    dt = numbers.get("dt")
    if dt is None or dt.size != 1:
        raise NoModelError("malformed", f"no sampling time given, expected dt = {data.dt:g}, s")
    if not abs(float(dt.ravel()[0]) - data.dt) <= SAME_DT * data.dt:
        raise NoModelError(
            "malformed",
            f"dt = {float(dt.ravel()[0]):g} given, expected a discrete-time model with that of the record, {data.dt:g}",
        )


def _state_space(numbers: Numbers, data: IOData, innovation: FloatArray | None) -> StateSpace:
    a = numbers["A"]
    n = 0 if a.size == 0 else (a.shape[0] if a.ndim else 1)
    if n > MOST_ORDER:
        raise NoModelError("malformed", f"A of shape {a.shape} given, expected at most {MOST_ORDER} states")
    shapes = {"A": (n, n), "B": (n, data.nu), "C": (data.ny, n), "D": (data.ny, data.nu), "K": (n, data.ny)}
    m = {name: shaped(name, numbers[name], shape) for name, shape in shapes.items() if name in numbers}
    return StateSpace(m["A"], m["B"], m["C"], m.get("D", np.zeros(shapes["D"])), m.get("K"), data.dt, innovation)


def _polynomials(numbers: Numbers, data: IOData) -> Polynomials | None:
    """The polynomials among the numbers; None where there are none. One fraction is an output-error model."""
    if "num" in numbers and (data.nu, data.ny) == (1, 1):
        return _output_error(*(row(name, numbers[name]) for name in FRACTION))
    if "poly_b" not in numbers:
        return None
    if data.ny != 1:
        raise NoModelError(
            "malformed", f"polynomials given for {data.ny} outputs, expected matrices: they have one output"
        )
    rows = {}
    for name, letter in POLYNOMIALS.items():
        if name not in numbers:
            continue
        values = numbers[name]
        if data.nu > 1 and letter in "BF":
            if values.ndim != 2 or len(values) != data.nu:
                raise NoModelError(
                    "malformed", f"{name} of shape {values.shape} given, expected a row for each of {data.nu} inputs"
                )
        else:
            values = row(name, values)
        if letter != "B" and not (np.atleast_2d(values)[:, 0] == 1.0).all():
            raise NoModelError("malformed", f"{name} begins with {values.ravel()[0]:g}, expected 1")
        rows[letter] = values
    return Polynomials(**rows)


def _output_error(num: FloatArray, den: FloatArray) -> Polynomials:
    """Numerator and denominator of equal length, the denominator scaled to begin with 1."""
    if len(num) != len(den):
        raise NoModelError(
            "malformed",
            f"num with {len(num)} and den with {len(den)} coefficients given, expected as many of both: filled up "
            "with zeros, powers of z and of 1/z mean the same",
        )
    if den[0] == 0.0:
        raise NoModelError("malformed", "den begins with 0, expected the coefficient of its highest power of z")
    with np.errstate(over="ignore"):
        num, den = num / den[0], den / den[0]
    if not (np.isfinite(num).all() and np.isfinite(den).all()):
        raise NoModelError("not_finite", f"num and den divided by {den[0]:g}, the first of den, are not finite")
    return Polynomials(B=num, F=den)


def _of_fractions(numbers: Numbers, data: IOData) -> StateSpace:
    """The model of fractions (ny, nu, k), one for each pair of output and input, side by side."""
    num, den = (numbers[name] for name in FRACTION)
    for name in FRACTION:
        if numbers[name].ndim != 3 or numbers[name].shape[:2] != (data.ny, data.nu):
            raise NoModelError(
                "malformed",
                f"{name} of shape {numbers[name].shape} given, expected ({data.ny}, {data.nu}, number of coefficients)",
            )
    paths = {
        (i, j): innovations_form(_output_error(num[i, j], den[i, j]), data.dt) for i, j in np.ndindex(data.ny, data.nu)
    }
    n, at = sum(path.order for path in paths.values()), 0
    a, b, c, d = np.zeros((n, n)), np.zeros((n, data.nu)), np.zeros((data.ny, n)), np.zeros((data.ny, data.nu))
    for (i, j), path in paths.items():
        part = slice(at, at + path.order)
        a[part, part], b[part, [j]], c[[i], part], d[i, j] = path.A, path.B, path.C, path.D[0, 0]
        at += path.order
    return StateSpace(a, b, c, d, None, data.dt)

"""Random systems by difficulty, each with its own noise: no estimator has been tuned to them."""

from dataclasses import dataclass

import numpy as np

from scenarios.estimators.seeds import generator_of
from scenarios.files.errors import ScenarioError
from scenarios.problems.linear_problem import BinaryExcitation, LinearProblem
from sysid import Polynomials, SysidError
from sysid.models.delta_method import standard_directions
from sysid.models.polynomials import is_stable
from sysid.polynomial.orders import Orders
from sysid.polynomial.structures import layout
from sysid.records.arrays import FloatArray
from sysid.validation import CramerRaoBound
from sysid.validation.cramer_rao import response_gradient

STRUCTURES = ("bj", "oe", "armax")
"""In turn, beginning with number 3: number 1 is an output-error system."""


@dataclass(frozen=True)
class Difficulty:
    """Ranges from which the systems of a difficulty are drawn.

    Attributes:
        poles: Least and greatest number.
        modulus: Least and greatest of the poles; the nearer to 1, the longer the memory.
        damping: Least damping ratio of pairs of poles: less is a sharper resonance.
        delay: Greatest nk.
        deviation: Greatest standard deviation of the response below the bandwidth, over its size, by the bound.
        excitation: Bits held longer leave the fast poles less excited.
    """

    poles: tuple[int, int]
    modulus: tuple[float, float]
    damping: float
    delay: int
    deviation: float
    excitation: BinaryExcitation


_EASY = Difficulty((1, 2), (0.5, 0.85), 0.5, 1, 0.05, BinaryExcitation(1, 2000, 30.0))
_MEDIUM = Difficulty((2, 4), (0.5, 0.93), 0.2, 2, 0.10, BinaryExcitation(2, 2000, 20.0))
_HARD = Difficulty((4, 6), (0.5, 0.98), 0.05, 3, 0.30, BinaryExcitation(3, 4000, 10.0))
DIFFICULTIES = {"easy": _EASY, "medium": _MEDIUM, "hard": _HARD}

TRIALS = 60
"""Perfect estimates by which a candidate is judged."""

CURVED = 0.2
"""How far their responses may be from linear in the parameters, in deviations: there the bound describes estimates."""

CANDIDATES = 5000


def random_problem(difficulty: str, number: int, name: str, samples: int | None) -> LinearProblem:
    """Make the problem of a difficulty and a number: a random system, the same for the same name.

    Drawn until its bandwidth lies between 1 % and 60 % of the Nyquist frequency, the bound on its response at the full
    length within what the difficulty allows, and perfect estimates are stable and about as linear in the parameters as
    the bound takes them: verdicts are then about the estimator, not about the limits of the theory.

    Args:
        difficulty: One of `DIFFICULTIES`.
        number: From 1.
        name: The problem's name.
        samples: Of a record; None: as many as the difficulty has.

    Raises:
        ScenarioError: No system was found.
    """
    wanted = DIFFICULTIES[difficulty]
    rng = generator_of(f"random-{difficulty}-{number}")
    order = int(rng.integers(wanted.poles[0], wanted.poles[1] + 1))
    for _ in range(CANDIDATES):
        truth = _system(rng, wanted, order, STRUCTURES[number % len(STRUCTURES)])
        candidate = wanted.excitation.problem(name, truth)
        if _is_suitable(candidate, wanted, rng):
            return candidate if samples is None else wanted.excitation.problem(name, truth, samples)
    raise ScenarioError(f"{name}: none of {CANDIDATES} systems drawn is {difficulty}")


def _system(rng: np.random.Generator, wanted: Difficulty, order: int, structure: str) -> Polynomials:
    """Draw a system of an order and a structure within the ranges of a difficulty."""
    poles = _monic(rng, order, wanted.modulus, wanted.damping)
    delay = int(rng.integers(1, wanted.delay + 1))
    b = rng.standard_normal(int(rng.integers(1, order + 1)))
    # A steady-state gain of 1.
    b = np.concatenate((np.zeros(delay), b * poles.sum() / b.sum()))
    # Drawn for every structure: the sequence of draws says which system a number is.
    noise = [_monic(rng, 2, (0.2, 0.8), 0.1) for _ in range(2)]
    if structure == "oe":
        return Polynomials(B=b, F=poles)
    if structure == "armax":
        return Polynomials(A=poles, B=b, C=_monic(rng, order, (0.2, 0.8), 0.1))
    return Polynomials(B=b, C=noise[0], D=noise[1], F=poles)


def _monic(rng: np.random.Generator, count: int, modulus: tuple[float, float], damping: float) -> FloatArray:
    """A polynomial with random roots: real ones of positive sign, and pairs of a damping ratio."""
    roots: list[complex] = []
    while len(roots) < count:
        radius = rng.uniform(*modulus)
        if count - len(roots) >= 2 and rng.random() < 0.6:
            ratio = rng.uniform(damping, 0.9)
            # The pole exp(-ratio w + j w sqrt(1 - ratio^2)) has this angle; 2.5 keeps it off the Nyquist frequency.
            turn = min(-np.log(radius) * np.sqrt(1.0 - ratio**2) / ratio, 2.5)
            roots += [radius * np.exp(1j * turn), radius * np.exp(-1j * turn)]
        else:
            roots.append(radius)
    return np.atleast_1d(np.asarray(np.poly(np.array(roots, dtype=complex)).real, dtype=np.float64))


def _is_suitable(candidate: LinearProblem, wanted: Difficulty, rng: np.random.Generator) -> bool:
    """Whether a system has a bandwidth and accuracy within the difficulty, and errors to which its bound applies."""
    bandwidth = float(candidate.truth.bandwidth()[0, 0])
    embedded = candidate.embedded(None)
    # As a share of the Nyquist frequency; NaN, where there is no bandwidth, fails too.
    if not 0.01 <= 2.0 * candidate.dt * bandwidth <= 0.6 or embedded is None:
        return False
    try:
        bound = candidate.bound(None)
    # The information matrix of some systems is singular to rounding.
    except SysidError:
        return False
    if bound is None:
        return False
    inside = bound.frequencies <= bandwidth
    deviation = np.sqrt(np.sum(bound.response_directions**2, axis=(0, 4)))
    if not (deviation[inside] <= wanted.deviation * np.abs(bound.response[inside])).all():
        return False
    orders = layout(candidate.structure, embedded.orders)
    return _linear_within_bound(bound, orders, candidate.dt, deviation, rng)


def _linear_within_bound(
    bound: CramerRaoBound, orders: Orders, dt: float, deviation: FloatArray, rng: np.random.Generator
) -> bool:
    """Whether perfect estimates are stable, and their responses linear in the parameters to within `CURVED`."""
    if bound.polynomials is None:
        return False
    directions = standard_directions(bound.covariance)
    # Eigenvectors have the signs that a processor's LAPACK gives them: these must not decide on a system.
    largest = directions[np.abs(directions).argmax(axis=0), np.arange(directions.shape[1])]
    directions = directions * np.sign(largest)
    _, derivatives = response_gradient(bound.polynomials, orders, dt, bound.frequencies)
    beyond = np.empty((TRIALS, *bound.response.shape))
    for k in range(TRIALS):
        step = directions @ rng.standard_normal(len(directions))
        estimate = orders.polynomials(bound.parameters + step)
        poles = np.convolve(estimate.A, estimate.F)
        if not (is_stable(poles) and is_stable(estimate.C) and is_stable(estimate.D)):
            return False
        response, _ = response_gradient(estimate, orders, dt, bound.frequencies)
        # What the first-order step does not explain, in deviations of the bound.
        beyond[k] = np.abs(response - bound.response - np.tensordot(step, derivatives, 1)) / deviation
    return bool((np.sqrt(np.mean(beyond**2, axis=0)) <= CURVED).all())

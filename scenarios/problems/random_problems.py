"""Random systems by difficulty, each with its own noise: no estimator has been tuned to them."""

from dataclasses import dataclass

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.files.errors import ScenarioError
from scenarios.problems.bound import response_derivatives
from scenarios.problems.embedding import layout
from scenarios.problems.linear_problem import BURN_IN, LinearProblem
from scenarios.problems.problem import Bound, generator_of
from scenarios.problems.textbook import binary_sequence, noise_variance
from sysid import Polynomials
from sysid.models.delta_method import standard_directions
from sysid.models.polynomials import is_stable
from sysid.records.arrays import ComplexArray, FloatArray

STRUCTURES = ("bj", "oe", "armax")
"""In turn, beginning with number 3: number 1 is an output-error system."""


@dataclass(frozen=True)
class Difficulty:
    """Ranges from which the systems of a difficulty are drawn.

    Attributes:
        poles: Least and greatest number.
        modulus: Least and greatest of the poles; the nearer to 1, the longer the memory.
        damping: Least damping ratio of pairs of poles: less is a sharper resonance.
        signal_to_noise_db: Power of the output over that of the noise, dB.
        hold: Samples for which every bit of the binary input is held: more leaves the fast poles less excited.
        delay: Greatest nk.
        samples: Of a record.
        deviation: Greatest standard deviation of the response below the bandwidth, over its size, by the bound.
    """

    poles: tuple[int, int]
    modulus: tuple[float, float]
    damping: float
    signal_to_noise_db: float
    hold: int
    delay: int
    samples: int
    deviation: float


DIFFICULTIES = {
    "easy": Difficulty((1, 2), (0.5, 0.85), 0.5, 30.0, 1, 1, 2000, 0.05),
    "medium": Difficulty((2, 4), (0.5, 0.93), 0.2, 20.0, 2, 2, 2000, 0.10),
    "hard": Difficulty((4, 6), (0.5, 0.98), 0.05, 10.0, 3, 3, 4000, 0.30),
}

TRIALS = 60
"""Perfect estimates by which a candidate is judged."""

CURVED = 0.2
"""How far their responses may be from linear in the parameters, in deviations: there the bound describes estimates."""

CANDIDATES = 5000


def random_problem(difficulty: str, number: int, name: str, samples: int | None) -> LinearProblem:
    """The system of a difficulty and a number.

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
    full = binary_sequence(wanted.samples + BURN_IN, wanted.hold)[:, None]
    for _ in range(CANDIDATES):
        truth = _system(rng, wanted, order, STRUCTURES[number % len(STRUCTURES)])
        variance = noise_variance(truth, full, wanted.signal_to_noise_db)
        candidate = LinearProblem(name, truth, full, variance, SAMPLE_TIME)
        if _fair(candidate, wanted, rng):
            if samples is None:
                return candidate
            reference = binary_sequence(samples + BURN_IN, wanted.hold)[:, None]
            return LinearProblem(name, truth, reference, variance, SAMPLE_TIME)
    raise ScenarioError(f"{name}: none of {CANDIDATES} systems drawn is {difficulty}")


def _system(rng: np.random.Generator, wanted: Difficulty, order: int, structure: str) -> Polynomials:
    poles = _monic(_roots(rng, order, wanted.modulus, wanted.damping))
    delay = int(rng.integers(1, wanted.delay + 1))
    b = rng.standard_normal(int(rng.integers(1, order + 1)))
    b = np.concatenate((np.zeros(delay), b * poles.sum() / b.sum()))
    noise = [_monic(_roots(rng, 2, (0.2, 0.8), 0.1)) for _ in range(2)]
    if structure == "oe":
        return Polynomials(B=b, F=poles)
    if structure == "armax":
        return Polynomials(A=poles, B=b, C=_monic(_roots(rng, order, (0.2, 0.8), 0.1)))
    return Polynomials(B=b, C=noise[0], D=noise[1], F=poles)


def _monic(roots: ComplexArray) -> FloatArray:
    return np.atleast_1d(np.asarray(np.poly(roots).real, dtype=np.float64))


def _roots(rng: np.random.Generator, count: int, modulus: tuple[float, float], damping: float) -> ComplexArray:
    """Real ones of positive sign, and pairs of a damping ratio."""
    out: list[complex] = []
    while len(out) < count:
        radius = rng.uniform(*modulus)
        if count - len(out) >= 2 and rng.random() < 0.6:
            ratio = rng.uniform(damping, 0.9)
            turn = min(-np.log(radius) * np.sqrt(1.0 - ratio**2) / ratio, 2.5)
            out += [radius * np.exp(1j * turn), radius * np.exp(-1j * turn)]
        else:
            out.append(radius)
    return np.array(out, dtype=complex)


def _fair(candidate: LinearProblem, wanted: Difficulty, rng: np.random.Generator) -> bool:
    bandwidth = float(candidate.truth.bandwidth()[0, 0])
    if not 0.01 <= 2.0 * candidate.dt * bandwidth <= 0.6:
        return False
    try:
        bound = candidate.bound(None)
    except ScenarioError:
        return False
    if bound is None:
        return False
    inside = bound.frequencies <= bandwidth
    size = np.sqrt(np.sum(bound.response_directions**2, axis=(0, 4)))
    if not (size[inside] <= wanted.deviation * np.abs(bound.response[inside])).all():
        return False
    return _as_linear_as_the_bound(candidate, bound, size, rng)


def _as_linear_as_the_bound(candidate: LinearProblem, bound: Bound, size: FloatArray, rng: np.random.Generator) -> bool:
    embedded = candidate.embedded(None)
    if embedded is None or bound.polynomials is None:
        return False
    orders = layout(candidate.structure, embedded.orders)
    directions = standard_directions(bound.covariance)
    _, derivatives = response_derivatives(bound.polynomials, orders, candidate.dt, bound.frequencies)
    beyond = np.empty((TRIALS, *bound.response.shape))
    for k in range(TRIALS):
        step = directions @ rng.standard_normal(len(directions))
        moved = orders.polynomials(bound.parameters + step)
        if not (is_stable(np.convolve(moved.A, moved.F)) and is_stable(moved.C) and is_stable(moved.D)):
            return False
        response, _ = response_derivatives(moved, orders, candidate.dt, bound.frequencies)
        beyond[k] = np.abs(response - bound.response - np.tensordot(step, derivatives, 1)) / size
    return bool((np.sqrt(np.mean(beyond**2, axis=0)) <= CURVED).all())

"""The polynomials of a prediction-error model, and their state space in innovation form."""

from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.state_space import StateSpace
from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import FloatArray, Locked, lock, real_array, rectangular
from sysid.records.errors import SysidError
from sysid.records.printing import polynomial

ONE = np.ones(1)
SURE = 1e-6  # distance of roots from the unit circle that rounding does not hide


@dataclass(frozen=True, eq=False, repr=False)
class Polynomials(Locked):
    """A(q) y = B(q)/F(q) u + C(q)/D(q) e, coefficients of falling powers q^0, q^-1, ... [Ljung1999, eq. 4.33].

    Omitted polynomials are 1 (B: 0): `Polynomials(B=[0, 0.1], F=[1, -0.9])` is an output-error model. Of a time series
    without input B is empty: `Polynomials(A=[1, -0.9], B=[])`.

    Attributes:
        A: 1, a1, ..., (na + 1,).
        B: nk zeros, then b1, b2, ..., (nk + nb,). With several inputs (nu, longest): a row each, padded with zeros.
        C: 1, c1, ..., (nc + 1,).
        D: 1, d1, ..., (nd + 1,).
        F: 1, f1, ..., (nf + 1,). With several inputs (nu, longest): a row each, padded with zeros.

    Raises:
        SysidError: A, C, D or F does not begin with 1, or B and F have rows for different numbers of inputs.
    """

    A: FloatArray = field(default_factory=lambda: ONE)
    B: FloatArray = field(default_factory=lambda: np.zeros(1))
    C: FloatArray = field(default_factory=lambda: ONE)
    D: FloatArray = field(default_factory=lambda: ONE)
    F: FloatArray = field(default_factory=lambda: ONE)

    def __post_init__(self) -> None:
        """Check and lock."""
        rectangular("B", self.B)
        # left out, F is one for every input
        if self.F is ONE and np.ndim(self.B) == 2:
            object.__setattr__(self, "F", np.ones((len(self.B), 1)))
        if not np.size(self.B):
            object.__setattr__(self, "B", np.zeros((0, 1)))
            object.__setattr__(self, "F", np.ones((0, 1)))
        for name in "ABCDF":
            value = np.atleast_1d(real_array(name, getattr(self, name)))
            # B and F have a row per input
            dimensions = 2 if name in "BF" else 1
            if value.ndim > dimensions or value.shape[-1] == 0:
                raise SysidError(f"{name}: expected a row of coefficients, got shape {value.shape}")
            if name != "B" and not (np.atleast_2d(value)[:, 0] == 1.0).all():
                raise SysidError(f"{name} must begin with 1, got {value}")
            object.__setattr__(self, name, lock(value))
        if np.atleast_2d(self.B).shape[0] != np.atleast_2d(self.F).shape[0]:
            raise SysidError(f"B and F need a row per input each, got shapes {self.B.shape} and {self.F.shape}")

    def __str__(self) -> str:
        """The equation of the model and its polynomials."""
        rows = self._named_rows()

        def factor(name: str) -> str:
            return f"{name}(q)" if name in rows else ""

        def term(numerator: str, denominator: str, signal: str) -> str:
            above, below = factor(numerator), factor(denominator)
            fraction = f"{above or '1'}/{below}" if below else above
            return f"{fraction} {signal}(t)".lstrip()

        right = [term(f"B{j}", f"F{j}", f"u{j}") for j in self._input_labels()]
        right.append(term("C", "D", "e"))
        equation = f"{term('A', '', 'y')} = {' + '.join(right)}"
        lines = [f"  {polynomial(name, row)}".replace("\n", "\n  ") for name, row in rows.items()]
        return "\n".join((equation, *lines))

    def _input_labels(self) -> list[str]:
        """What follows B, F and u in the text: nothing for one input, else a number."""
        return [""] * self.nu if self.nu <= 1 else [str(j + 1) for j in range(self.nu)]

    def _named_rows(self) -> dict[str, FloatArray]:
        """Polynomials other than one by their names in the text, B1, B2, ... of several inputs."""
        rows: dict[str, FloatArray] = {}
        for letter in "ABFCD":
            labels = self._input_labels() if letter in "BF" else [""]
            for label, row in zip(labels, np.atleast_2d(getattr(self, letter)), strict=True):
                if not np.array_equal(_trim(row), ONE):
                    rows[letter + label] = row
        return rows

    @property
    def nu(self) -> int:
        """Number of inputs."""
        return int(np.atleast_2d(self.B).shape[0])

    def channel(self, j: int) -> tuple[FloatArray, FloatArray]:
        """B and F of input j, without trailing zeros."""
        j = whole_number("j", j, -self.nu, self.nu - 1)
        b, f = np.atleast_2d(self.B)[j], np.atleast_2d(self.F)[j]
        return _trim(b), _trim(f)


def innovations_form(polynomials: Polynomials, dt: float, variance: ArrayLike | None = None) -> StateSpace:
    """State space in observer companion form: for one denominator, K = c - a [Morris1996, eq. 4.9].

    ARX, ARMAX and OE with one input share one companion block. With F beside A, with D, or with several F, every
    input path B/F and the noise path C/D have a block each, and 1/A follows their sum: the poles of A, which may be
    unstable, occur once, so that the predictor is stable.

    Args:
        polynomials: A, B, C, D, F.
        dt: Sampling interval in s.
        variance: Variance of the innovation, in output units squared, a number or (1, 1) as an estimate's
            `noise_variance`; None if unknown.

    Returns:
        The model, one output, x(t+1) = A x + B u + K e, y = C x + D u + e.

    Raises:
        SysidError: An argument other than polynomials, dt not positive, a negative variance.
    """
    if not isinstance(polynomials, Polynomials):
        raise SysidError(f"expected Polynomials, got {type(polynomials).__name__}; an estimate's are .polynomials")
    p = polynomials
    channels = [p.channel(j) for j in range(p.nu)]
    a, c, d = _trim(p.A), _trim(p.C), _trim(p.D)
    covariance = None
    if variance is not None:
        single = np.reshape(variance, ()) if np.shape(variance) == (1, 1) else variance
        expected = "be a variance >= 0, a number or a matrix (1, 1)"
        covariance = np.array([[real_number("variance", single, expected, lambda v: 0.0 <= v < np.inf)]])
    # the innovation is one more input
    numerators = [b for b, _ in channels] + [c]
    denominators = [f for _, f in channels] + [d]
    if all(len(denominator) == 1 for denominator in denominators):
        A, B, C, D = _companion(a, numerators)
    else:
        if np.array_equal(c, d):
            # white noise: the pair would add states that cancel
            numerators[-1] = denominators[-1] = ONE
        A, B, C, D = _parallel_paths(numerators, denominators)
        if len(a) > 1:
            A, B, C, D = _followed_by_inverse(a, A, B, C, D)
    return StateSpace(A, B[:, :-1], C, D[:, :-1], B[:, -1:], dt, covariance)


Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def _parallel_paths(numerators: list[FloatArray], denominators: list[FloatArray]) -> Matrices:
    """A, B, C and D of the sum of paths with an input, a numerator and a denominator each."""
    blocks = []
    for j, denominator in enumerate(denominators):
        of_inputs = [np.zeros(1)] * len(numerators)
        of_inputs[j] = numerators[j]
        blocks.append(_companion(denominator, of_inputs))
    A_blocks, B_blocks, C_blocks, D_blocks = zip(*blocks, strict=True)
    A = np.asarray(scipy.linalg.block_diag(*A_blocks))
    return A, np.vstack(B_blocks), np.hstack(C_blocks), np.sum(D_blocks, axis=0)


def _followed_by_inverse(a: FloatArray, A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> Matrices:
    """The system with its output filtered by 1/a, whose states come first."""
    inverse, into, out, _ = _companion(a, [ONE])
    chain = np.block([[inverse, into @ C], [np.zeros((len(A), len(inverse))), A]])
    # the output of 1/a has the direct term 1, so that D stays
    return chain, np.vstack((into @ D, B)), np.hstack((out, C)), D


def is_stable(polynomial: FloatArray, margin: float = 0.0) -> bool:
    """Whether all roots of z^n + p1 z^(n-1) + ... lie inside the circle of radius 1 - margin, whatever the rounding."""
    if distance_bound(polynomial.tolist()) > max(margin, SURE):
        return True  # a shortcut: every step of a search calls this
    trimmed = _trim(polynomial)
    roots = np.roots(trimmed)
    # rounding moves m roots that nearly coincide by its m-th root
    rounding = np.finfo(float).eps * np.polyval(np.abs(trimmed), np.abs(roots))
    uncertainty = np.full(len(roots), np.inf)
    with np.errstate(divide="ignore"):
        for m, slope in enumerate(_scaled_derivatives(trimmed, roots), start=1):
            uncertainty = np.minimum(uncertainty, (rounding / np.abs(slope)) ** (1.0 / m))
    return bool((np.abs(roots) + uncertainty < 1.0 - margin).all())


def _scaled_derivatives(polynomial: FloatArray, points: np.ndarray) -> np.ndarray:
    """Derivatives of order m = 1, ..., n, divided by m!, at points (k,): (n, k), by one Horner scheme for all."""
    n = len(polynomial) - 1
    # zeros in front of the lower degrees leave their sums as they are
    coefficients = np.zeros((n, n))
    derivative = polynomial
    for m in range(1, n + 1):
        derivative = derivative[:-1] * np.arange(n + 1 - m, 0, -1) / m
        coefficients[m - 1, m - 1 :] = derivative
    values = np.zeros((n, len(points)), dtype=points.dtype)
    for column in coefficients.T:
        values = values * points + column[:, None]
    return values


def distance_bound(row: list[float]) -> float:
    """Lower bound on the distance of all roots from the unit circle, 0 if not all lie inside it [Jury1964].

    With reflection coefficients k of the Schur-Cohn recursion, the polynomial exceeds prod(1 - |k|) on the circle, and
    every other root contributes at most a factor 2.
    """
    bound = 2.0
    while len(row) > 1:
        k = row[-1] / row[0]
        bound *= 0.5 * (1.0 - abs(k))
        if not bound > 0.0:
            return 0.0
        row = [x - k * y for x, y in zip(row[:-1], row[:0:-1], strict=True)]
    return bound


def stabilised(polynomial: FloatArray, radius: float = 0.995) -> FloatArray:
    """Reflect roots outside the unit circle into it, and scale those beyond `radius` back to it."""
    roots = np.roots(polynomial)
    if (np.abs(roots) < radius).all():
        return polynomial
    # a reflected root changes the magnitude on the circle by a constant factor only
    outside = np.abs(roots) > 1.0
    roots[outside] = 1.0 / roots[outside].conj()
    too_close = np.abs(roots) > radius
    roots[too_close] *= radius / np.abs(roots[too_close])
    return _pad(np.atleast_1d(np.poly(roots).real), len(polynomial))


def _trim(row: FloatArray) -> FloatArray:
    """Coefficients without trailing zeros, one at least."""
    nonzero = np.flatnonzero(row)
    return row[: nonzero[-1] + 1] if len(nonzero) else row[:1]


def _pad(row: FloatArray, length: int) -> FloatArray:
    """Coefficients with zeros appended up to a length."""
    return np.concatenate((row, np.zeros(length - len(row))))


def _companion(denominator: FloatArray, numerators: list[FloatArray]) -> Matrices:
    """A, B, C and D in observer companion form of one output, y = sum of b_j / a u_j.

    A has -a1, -a2, ... in its first column, B the rows b_k - b_0 a_k.
    """
    n = max(len(denominator), *(len(b) for b in numerators)) - 1
    a = _pad(denominator, n + 1)
    A = np.eye(n, k=1)
    if n:
        A[:, 0] = -a[1:]
    padded = [_pad(b, n + 1) for b in numerators]
    B = np.array([b[1:] - b[0] * a[1:] for b in padded]).T.reshape(n, len(padded))
    C = np.eye(1, n)
    D = np.array([[b[0] for b in padded]])
    return A, B, C, D

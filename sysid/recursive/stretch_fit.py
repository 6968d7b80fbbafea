"""Output-error models of a stretch of a record whose disturbance has a known colour.

y = B(q)/F(q) u + free response + constant + 1/D(q) e. The stretch may begin in the middle of a motion: the free
response that the past left in n states is estimated with the model, so nothing before the stretch biases it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from sysid.models.sampling import lagged_input
from sysid.records.arrays import FloatArray, Locked
from sysid.records.errors import SysidError

FASTEST = 0.85  # pole of the first guess: five samples, between the samples and the stretch
MOST_STEPS = 30  # limit on Gauss-Newton steps
SETTLED = 1e-4  # relative decrease of the cost below which a search ends
PREFILTERS = 10  # rounds of prefiltering that give the initial estimate
PREFILTER_SETTLED = 1e-6  # change of the coefficients of F at which they end
SHORTEST_STEP = 1e-3  # part of a Gauss-Newton step below which the search ends
SLOWEST = 10.0  # a real mode slower than the stretch over this is an offset or a drift
RINGING = 5.0  # a mode that rings longer than the stretch over this is noise
STEADIEST = 0.998  # largest modulus of its poles: a ring of 10 s at 50 Hz
KNOWN = 1e-9  # smallest singular value of the scaled gradients that counts, relative to the largest
EXACT = 1e-20  # power of the errors, relative to the output, that is rounding alone
COMMON = 0.5  # pole and zero that a model gets as the start of one with a degree more
PENALTY = 3.0  # of the criterion, per parameter


@dataclass(frozen=True, eq=False, repr=False)
class StretchFit(Locked):
    """A model of a stretch, and what a recursion needs to continue it.

    Attributes:
        B: Coefficients of the numerator from lag nk (n,).
        F: Denominator (n + 1,), monic.
        nuisance: Free response (n,) and constant, in units of the output.
        directions: Independent steps of one standard deviation each, for e of unit variance (3n + 1, r): B, F, free
            response, constant. Parameters of which the stretch tells nothing do not move.
        variance: Of e, unbiased.
        errors: Estimates of e over the stretch (rows,), without the samples that D takes to start.
        gradients: Of the predictions (rows, 3n + 1), likewise.
    """

    B: FloatArray
    F: FloatArray
    nuisance: FloatArray
    directions: FloatArray
    variance: float
    errors: FloatArray
    gradients: FloatArray

    @property
    def order(self) -> int:
        """Degree n of F."""
        return len(self.B)

    @property
    def criterion(self) -> float:
        """AIC3, corrected for short stretches [HurvichTsai1989].

        Akaike's penalty of 2 takes the likelihood for regular. A pole that a zero cancels may stand anywhere, and the
        best place for the noise is found each time: 3 per parameter, as for mixtures [Bozdogan1994].
        """
        N, p = self.gradients.shape
        power = self.errors @ self.errors / N
        log_likelihood = N * float(np.log(power + np.finfo(float).tiny))
        return log_likelihood + PENALTY * p * N / (N - p - 2)


def fit_degrees(
    u: FloatArray,
    y: FloatArray,
    begin: int,
    orders: Sequence[int],
    nk: int,
    D: FloatArray,
    last: StretchFit | None = None,
) -> list[StretchFit]:
    """Fit y[begin:] by models of several degrees.

    Each search ends with Gauss-Newton steps. It starts from the prefiltered least squares of [SteiglitzMcBride1965] and
    from the model before, with a pole and a zero that cancel.

    Args:
        u: Input (N,), with the samples before `begin` as far as they are known.
        y: Output (N,).
        begin: First sample of the stretch.
        orders: Degrees n of F, numbers of coefficients of B, ascending.
        nk: Delay in samples.
        D: Whitening filter of the disturbance, monic.
        last: Fit of the same plant to a shorter stretch, another start.

    Returns:
        The models by degree; degrees for which the stretch is too short are left out.

    Raises:
        SysidError: The stretch is too short for any of the orders.
    """
    fits: list[StretchFit] = []
    for n in orders:
        # two samples per parameter
        if len(y) - begin - len(D) <= 2 * (3 * n + 1):
            continue
        first_F = np.asarray(np.poly(np.full(n, FASTEST)), dtype=float)
        starts = [_prefiltered_least_squares(u, y, begin, nk, D, first_F)]
        if last is not None and last.order == n:
            starts.append((last.B, last.F))
        if fits:
            common = np.poly(np.full(n - fits[-1].order, COMMON))
            starts.append((np.convolve(fits[-1].B, common), np.convolve(fits[-1].F, common)))
        from_starts = [_gauss_newton(u, y, begin, nk, D, B, F) for B, F in starts]
        fits.append(min(from_starts, key=lambda fit: fit.variance))
    if not fits:
        raise SysidError(f"{len(y) - begin} samples given, expected more for a model of order {min(orders)}")
    return fits


def preferred(fits: Sequence[StretchFit]) -> StretchFit:
    """Return the model with the least criterion."""
    return min(fits, key=lambda fit: fit.criterion)


def model_weights(fits: Sequence[StretchFit]) -> FloatArray:
    """Return weights of models by degree (len(fits),), whose sum is one [Buckland1997].

    Half of each weight goes to the next degree: at the degree that balances bias and variance, the bias is no smaller
    than the deviation, and an interval must not miss it.
    """
    criteria = np.array([fit.criterion for fit in fits])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    next_degree = np.append(0.0, weights[:-1])
    next_degree[-1] += weights[-1]
    return np.asarray((weights + next_degree) / (2.0 * weights.sum()))


def _delayed_copies(x: FloatArray, first: int, count: int) -> FloatArray:
    """Columns of a signal (N,) delayed by first, first + 1, ... samples, from rest (N, count)."""
    columns = np.zeros((len(x), count))
    for k in range(count):
        columns[first + k :, k] = x[: len(x) - first - k]
    return columns


def _free_responses(F: FloatArray, count: int, samples: int) -> FloatArray:
    """Free responses of 1/F (samples, count) to pulses at the first samples."""
    pulse = np.eye(1, samples)[0]
    return _delayed_copies(scipy.signal.lfilter([1.0], F, pulse), 0, count)


def _whitened(D: FloatArray, columns: FloatArray) -> FloatArray:
    """Columns filtered by D, without the first rows, which lack the samples before the stretch."""
    degree = len(D) - 1
    rows = len(columns) - degree
    lagged = (columns[degree - k : degree - k + rows] for k in range(len(D)))
    return np.asarray(sum(d * column for d, column in zip(D, lagged, strict=True)))


def _scaled_least_squares(A: FloatArray, b: FloatArray) -> FloatArray:
    """Least squares of b = A x with columns scaled to unit length, of least norm where they are dependent."""
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0.0] = 1.0
    try:
        solution = np.linalg.lstsq(A / scale, b, rcond=1e-11)[0]
    except np.linalg.LinAlgError:
        # the divide-and-conquer SVD of LAPACK fails on rare matrices, QR on none
        solution = scipy.linalg.lstsq(A / scale, b, cond=1e-11, lapack_driver="gelsy")[0]
    return np.asarray(solution / scale)


def _largest_moduli(poles: np.ndarray[Any, Any], samples: int) -> FloatArray:
    """Largest admissible modulus of each pole, real or complex, of a model of so many samples."""
    slowest_real, longest_ring = np.maximum(np.exp(-np.array([SLOWEST, RINGING]) / samples), FASTEST)
    return np.where(np.isreal(poles), slowest_real, min(longest_ring, STEADIEST))


def _prefiltered_least_squares(
    u: FloatArray, y: FloatArray, begin: int, nk: int, D: FloatArray, F: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least squares of F y/F = B u/F, F from the round before [SteiglitzMcBride1965]."""
    n, samples = len(F) - 1, len(y) - begin
    past = lagged_input(u, nk)[begin:]
    B = np.zeros(n)
    for _ in range(PREFILTERS):
        inputs, outputs = scipy.signal.lfilter([1.0], F, past), scipy.signal.lfilter([1.0], F, y[begin:])
        model = np.hstack((_delayed_copies(inputs, 0, n), -_delayed_copies(outputs, 1, n)))
        # filters that begin at rest, and n lags of them: wrong by free responses to pulses at the first 2n samples
        columns = np.hstack((model, _free_responses(F, 2 * n, samples), np.ones((samples, 1))))
        theta = _scaled_least_squares(_whitened(D, columns), _whitened(D, outputs))
        last_F, B, F = F, theta[:n], _with_bounded_poles(np.append(1.0, theta[n : 2 * n]), samples)
        if np.abs(F - last_F).max() < PREFILTER_SETTLED:
            break
    return B, F


def _with_bounded_poles(F: FloatArray, samples: int) -> FloatArray:
    """Denominator with the poles outside the unit circle mirrored, then kept clear of the largest moduli."""
    poles = np.roots(F)
    # a pole at zero has no direction
    size = np.maximum(np.abs(poles), 1e-12)
    mirrored = np.minimum(size, 1.0 / size)
    return np.real(np.poly(poles / size * np.minimum(mirrored, 0.999 * _largest_moduli(poles, samples))))


def gradient_rows(
    u: FloatArray, y: FloatArray, begin: int, nk: int, B: FloatArray, F: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return gradients (samples, 3n + 1), and errors without free response and constant (samples,), not whitened."""
    n, samples = len(B), len(y) - begin
    x = scipy.signal.lfilter([1.0], F, lagged_input(u, nk))
    simulated = scipy.signal.lfilter(B, [1.0], x)
    w = scipy.signal.lfilter([1.0], F, simulated)
    model = np.hstack((_delayed_copies(x, 0, n), -_delayed_copies(w, 1, n)))[begin:]
    columns = np.hstack((model, _free_responses(F, n, samples), np.ones((samples, 1))))
    return columns, y[begin:] - simulated[begin:]


@dataclass(frozen=True, eq=False)
class _Linearisation:
    """Whitened errors of one model and their derivatives, free response and constant at their best.

    Attributes:
        gradients: Of the predictions (rows, 3n + 1).
        target: Errors without free response and constant (rows,).
        nuisance: Free response and constant.
        errors: Errors (rows,).
        cost: Sum of their squares.
    """

    gradients: FloatArray
    target: FloatArray
    nuisance: FloatArray
    errors: FloatArray
    cost: float


def _linearised(
    u: FloatArray, y: FloatArray, begin: int, nk: int, D: FloatArray, B: FloatArray, F: FloatArray
) -> _Linearisation:
    columns, errors = gradient_rows(u, y, begin, nk, B, F)
    gradients, target = _whitened(D, columns), _whitened(D, errors)
    by_nuisance = gradients[:, 2 * len(B) :]
    nuisance = _scaled_least_squares(by_nuisance, target)
    errors = target - by_nuisance @ nuisance
    return _Linearisation(gradients, target, nuisance, errors, float(errors @ errors))


def _gauss_newton(
    u: FloatArray, y: FloatArray, begin: int, nk: int, D: FloatArray, B: FloatArray, F: FloatArray
) -> StretchFit:
    """Gauss-Newton steps from B and F, halved until the poles are within their bounds and the errors no larger."""
    n, samples = len(B), len(y) - begin
    at = _linearised(u, y, begin, nk, D, B, F)
    for _ in range(MOST_STEPS):
        step, size = _scaled_least_squares(at.gradients, at.target), 1.0
        while size > SHORTEST_STEP:
            next_B, next_F = B + size * step[:n], F + size * np.append(0.0, step[n : 2 * n])
            poles = np.roots(next_F)
            if (np.abs(poles) < _largest_moduli(poles, samples)).all():
                trial = _linearised(u, y, begin, nk, D, next_B, next_F)
                if trial.cost <= at.cost:
                    break
            size *= 0.5
        else:
            break
        decrease = at.cost - trial.cost
        B, F, at = next_B, next_F, trial
        # a shortened step may lead to better ones
        if decrease <= SETTLED * at.cost and size == 1.0:
            break
    return _stretch_fit(B, F, at, EXACT * float(np.mean(y**2)))


def _stretch_fit(B: FloatArray, F: FloatArray, at: _Linearisation, least_variance: float) -> StretchFit:
    """Fit with its independent steps of one standard deviation, from the gradients of the last linearisation."""
    scale = np.linalg.norm(at.gradients, axis=0)
    scale[scale == 0.0] = 1.0
    # by QR iterations, which converge where divide and conquer fails
    _, values, rows = scipy.linalg.svd(np.linalg.qr(at.gradients / scale, mode="r"), lapack_driver="gesvd")
    determined = values > KNOWN * values[0]
    directions = rows[determined].T / values[determined] / scale[:, None]
    variance = max(at.cost / (len(at.errors) - len(scale)), least_variance)
    return StretchFit(B, F, at.nuisance, directions, variance, at.errors, at.gradients)

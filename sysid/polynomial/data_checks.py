"""Checks of records before a fit: excitation of the inputs, and means that no linear model explains."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from sysid.polynomial.gram_matrices import hankel_moments
from sysid.polynomial.least_squares import solve
from sysid.polynomial.regressors import arx_equations
from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.trends import ROUNDING


def order_of_excitation(u: ArrayLike, *, max_order: int = 50, tolerance: float = 1e-6) -> int:
    """Order of persistent excitation: the largest n with a nonsingular n x n covariance matrix [Ljung1999, def. 13.1].

    A sinusoid has order 2, a constant 1, a sum of m sinusoids 2m; that of white noise is unlimited.

    Args:
        u: One input (N,) or (N, 1).
        max_order: Largest order tested; a return value of `max_order` means "at least".
        tolerance: Singular values of the matrix of lagged inputs below it, relative to the largest, count as zero.

    Returns:
        The order, 0 for an input that is zero, at most `max_order`.

    Raises:
        SysidError: Several channels, or max_order not between 1 and N/2.
    """
    if isinstance(u, IOData):
        raise SysidError("expected one input as an array (N,), got an IOData record: take data.u[:, 0]")
    signal = real_array("u", u)
    signal = signal[:, 0] if signal.ndim == 2 and signal.shape[1] == 1 else signal
    if signal.ndim != 1:
        raise SysidError(f"order_of_excitation looks at one input at a time, got shape {np.shape(u)}")
    if len(signal) < 2:
        raise SysidError(f"too few samples: {len(signal)} given, at least 2 are needed")
    max_order = whole_number("max_order", max_order, 1, len(signal) // 2)
    tolerance = real_number("tolerance", tolerance, "lie between 0 and 1", lambda part: 0.0 < part < 1.0)
    return _rank([signal], max_order, tolerance)


def _rank(signals: Sequence[FloatArray], order: int, tolerance: float) -> int:
    return _gram_rank(hankel_moments([signal[:, None] for signal in signals], order), tolerance)


def _gram_rank(gram: FloatArray, tolerance: float) -> int:
    # eigenvalues are squared singular values; rounding of the Gram matrix sets the floor
    values = np.linalg.eigvalsh(gram)
    floor = max(tolerance**2, len(gram) * np.finfo(float).eps)
    return int((values > floor * values[-1]).sum()) if values[-1] > 0.0 else 0


def check_excitation(experiments: Sequence[IOData], needed: Sequence[int]) -> list[str]:
    """Refuse constant channels; describe inputs that excite less than the `needed` orders, or are dependent."""
    nu, names = experiments[0].nu, experiments[0].input_names or ()
    shortest = min(len(e) for e in experiments)
    if max(len(e) for e in experiments) < 2:
        raise SysidError(f"too few samples: {len(experiments)} experiment(s) of 1 sample, at least 2 are needed")
    for i, name in enumerate(experiments[0].output_names or ()):
        parts = [e.y[e.known[:, i], i] for e in experiments]
        if all(np.ptp(y) <= ROUNDING * np.abs(y).max() for y in parts if len(y)):
            raise SysidError(f"output {name} is constant, which identifies nothing; expected a varying output")
    for j, name in enumerate(names):
        signals = [e.u[:, j] for e in experiments]
        if all(np.ptp(s) <= ROUNDING * np.abs(s).max() for s in signals):
            value = ", ".join(f"{s[0]:g}" for s in signals)
            raise SysidError(f"input {name} is constant ({value}), which identifies nothing; expected a varying input")
    # at least as many rows as columns
    lags = min(max((*needed, 1)), shortest // (nu + 1))
    messages = []
    for j, name in enumerate(names):
        order = min(needed[j], shortest // 2)
        excited = _rank([e.u[:, j] for e in experiments], order, 1e-6) if order >= 1 else needed[j]
        if excited < needed[j]:
            messages.append(
                f"input {name} is persistently exciting of order {excited} only, the model needs {needed[j]}: "
                "some parameters are determined by noise alone"
            )
    if nu > 1 and lags >= 1:
        # lags of all inputs, each of unit size, inputs side by side
        sizes = np.sqrt(np.mean(np.concatenate([e.u for e in experiments]) ** 2, axis=0))
        joint = hankel_moments([e.u / sizes for e in experiments], lags)
        together, alone = _gram_rank(joint, 1e-6), sum(_gram_rank(joint[j::nu, j::nu], 1e-6) for j in range(nu))
        if together < alone:
            what = "the inputs" if lags == 1 else f"{lags} lags of the inputs"
            messages.append(
                f"{what} {', '.join(names)} have rank {together} together and {alone} one by one: they are "
                "dependent, and the data cannot separate their effects"
            )
    return messages


ROWS_PER_COEFFICIENT = 5
LONGER = 10  # lags of outputs and inputs in the second, longer model
AVERAGED = 4  # samples of a mean, then means of a further mean
FEWEST = 40  # means of an experiment: fewer tell nothing
CERTAIN = 4.0  # offset, in its standard deviations, that counts as significant
EXACT = 1e4  # the same in data without noise
SERIOUS = 0.5  # offset, relative to mean or size of the output: a smaller one may be the bias of ARX by output noise


def check_means(experiments: Sequence[IOData], order: int) -> list[str]:
    """Describe outputs with an offset that the dynamics do not explain, which biases a model without one.

    The test is whether an ARX model, and a longer one, need a constant, of the samples or of means over 4, 16, ... of
    them. It is made only if the mean of some channel exceeds its standard deviation. Responses from rest and records
    that agree with the gain at 0 Hz pass. A model with an order beyond that of the dynamics can difference the data and
    needs no detrending. Of a time series, the mean alone tells.
    """
    dominant = _dominant(experiments)
    if not experiments[0].nu:
        return [f"{text}, as a slow pole that the series need not have; {ADVICE}" for text in dominant]
    messages = []
    for i, name in enumerate(experiments[0].output_names or () if dominant else ()):
        offset = _unexplained_offset(experiments, i, order)
        if offset:
            messages.append(
                f"{dominant[0]} and does not fit the dynamics: output {name} has an offset of about {offset:.4g} that "
                f"the model lacks; {ADVICE}"
            )
    return messages


def _unexplained_offset(experiments: Sequence[IOData], output: int, order: int) -> float:
    """Offset of an output that ARX models need, of the samples or of means over several; 0 if they need none."""
    # a model that is too small, or biased by output noise, may miss the gain at 0 Hz: a longer one must agree
    offset, certain = _missing_offset(experiments, output, order)
    longer, also = _missing_offset(experiments, output, max(order, LONGER))
    exact = np.isnan(also)
    if exact:
        # without noise the longer model can difference the data: then the first must be exact
        longer, also = (offset, certain) if certain > EXACT else (0.0, 0.0)
    y = _joined([e.y[e.window :, output] for e in experiments])
    least = SERIOUS * max(abs(float(np.nanmean(y))), float(np.nanstd(y)))
    if min(certain, also) > CERTAIN and min(abs(offset), abs(longer)) > least and offset * longer > 0.0:
        return offset
    if exact or min(len(e) for e in experiments) < AVERAGED * FEWEST:
        return 0.0
    # noise hides what a slow process does from one sample to the next
    return _unexplained_offset([_averaged(e) for e in experiments], output, order)


def _averaged(experiment: IOData) -> IOData:
    blocks = len(experiment) // AVERAGED
    u, y = (z[: blocks * AVERAGED].reshape(blocks, AVERAGED, -1).mean(axis=1) for z in (experiment.u, experiment.y))
    return replace(experiment, u=u, y=y, dt=AVERAGED * experiment.dt, window=experiment.window // AVERAGED)


ADVICE = "detrend first: data.detrend()"


def large_means(experiments: Sequence[IOData]) -> list[str]:
    """Describe channels whose mean exceeds their standard deviation, for frequency-domain methods."""
    return [f"{text} and leaks into low frequencies; {ADVICE}" for text in _dominant(experiments)]


def _dominant(experiments: Sequence[IOData]) -> list[str]:
    first = experiments[0]
    z = _joined([np.hstack((e.u, e.y))[e.window :] for e in experiments])
    means, sizes = np.nanmean(z, axis=0), np.nanstd(z, axis=0)
    names = (*(first.input_names or ()), *(first.output_names or ()))
    dominant = [
        f"{name} (mean {mean:.4g}, standard deviation {size:.4g})"
        for name, mean, size in zip(names, means, sizes, strict=True)
        if abs(mean) > size
    ]
    return [f"the mean dominates {', '.join(dominant)}"] if dominant else []


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _missing_offset(experiments: Sequence[IOData], output: int, order: int) -> tuple[float, float]:
    """Offset of an output, in its units and in standard deviations of the constant.

    Zeros if there are too few data, NaN if the constant depends on the other columns.
    """
    nu = experiments[0].nu
    usable = sum(len(e) - e.window for e in experiments)
    n = min(max(order, 1), usable // (ROWS_PER_COEFFICIENT * (1 + nu)), min(len(e) for e in experiments) // 2)
    if n < 1:
        return 0.0, 0.0
    starts = [max(n, e.window) for e in experiments]
    y, u = [e.y[:, output] for e in experiments], [e.u for e in experiments]
    phi, target = arx_equations(y, u, n, (n + 1,) * nu, (0,) * nu, starts)
    known = np.isfinite(phi).all(axis=1) & np.isfinite(target)
    phi, target = phi[known], target[known][:, None]
    if len(phi) <= phi.shape[1] + 1:
        return 0.0, 0.0
    with_constant = np.column_stack((phi, np.ones(len(phi))))
    fit = solve(with_constant, target)
    if fit.rank < with_constant.shape[1] and fit.rank == solve(phi, target).rank:
        return np.nan, np.nan
    constant = float(fit.solution[-1, 0])
    variance = float(fit.residual_gram[0, 0]) / (len(phi) - with_constant.shape[1])
    deviation = float(np.sqrt(variance * fit.inverse_gram[-1, -1]))
    # A at 0 Hz
    at_dc = 1.0 + float(fit.solution[:n, 0].sum())
    if at_dc == 0.0:
        return 0.0, 0.0
    return constant / at_dc, abs(constant) / max(deviation, np.finfo(float).tiny)

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
from sysid.records.errors import Message, SysidError
from sysid.records.trends import ROUNDING

POORLY_EXCITED = "poorly-excited"  # code of the message on an input that excites too few orders
INTERLEAVED = 8  # signals of spaced samples whose excitation is measured together, about
DEPENDENT = 1e-6  # singular value of lagged inputs, relative to the largest, that counts as zero


def order_of_excitation(u: ArrayLike, *, max_order: int = 50, tolerance: float = 1e-6) -> int:
    """Order of persistent excitation: the largest n with a nonsingular n x n covariance matrix [Ljung1999, def. 13.1].

    A sinusoid has order 2, a constant 1, a sum of m sinusoids 2m; that of white noise is unlimited. Successive samples
    of slow sinusoids are too alike for a numerical rank to count them; samples further apart are not, and the order of
    those is never above that of all: the largest over such spacings is returned.

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
    tolerance = real_number("tolerance", tolerance, "lie between 0 and 1", lambda value: 0.0 < value < 1.0)
    return _order_of_excitation([signal], max_order, tolerance)


def _order_of_excitation(
    signals: Sequence[FloatArray], max_order: int, tolerance: float = DEPENDENT, moments: FloatArray | None = None
) -> int:
    """Order of excitation by one input, a signal (N_i,) per experiment; at most `max_order`.

    The `moments` of `max_order` lags are computed unless they are known.

    The lags 0, s, 2 s, ... are those of the s signals that take every s-th sample. A polynomial in z^s that vanishes
    where there is power is a polynomial in z too, so that a wider spacing s never counts too much.
    """
    order, spacing = 0, 1
    if moments is not None:
        order, spacing = _gram_rank(moments, tolerance), 2
    longest = max(len(signal) for signal in signals)
    while order < max_order and (spacing == 1 or longest >= spacing * max_order):
        # fewer of the interleaved signals have fewer rows, which never raises the rank
        starts = range(0, spacing, max(spacing // INTERLEAVED, 1))
        interleaved = [signal[k::spacing, None] for signal in signals for k in starts]
        long_enough = [part for part in interleaved if len(part) >= max_order]
        order = max(order, _gram_rank(hankel_moments(long_enough, max_order), tolerance))
        spacing *= 2
    return order


def _gram_rank(gram: FloatArray, tolerance: float = DEPENDENT) -> int:
    """Numerical rank of a matrix from its Gram matrix, for a tolerance on singular values."""
    # eigenvalues are squared singular values; rounding of the Gram matrix sets the floor
    floor = max(tolerance**2, len(gram) * np.finfo(float).eps)
    # what remains after the largest floor is positive: the rank is full, as a triangle tells faster than eigenvalues
    bound = float(np.abs(gram).sum(axis=1).max(initial=0.0))
    try:
        np.linalg.cholesky(gram - 2.0 * floor * bound * np.eye(len(gram)))
        return len(gram)
    except np.linalg.LinAlgError:
        values = np.linalg.eigvalsh(gram)
    return int((values > floor * values[-1]).sum()) if values[-1] > 0.0 else 0


def check_excitation(experiments: Sequence[IOData], needed: Sequence[int], *, rest: bool = False) -> list[str]:
    """Refuse constant channels; describe inputs that excite less than the `needed` orders, or are dependent.

    From rest, an input that is constant throughout is a step at the first sample.
    """
    if max(len(e) for e in experiments) < 2:
        raise SysidError(f"too few samples: {len(experiments)} experiment(s) of 1 sample, at least 2 are needed")
    _refuse_constant_outputs(experiments)
    constant = constant_inputs(experiments)
    if not rest:
        _refuse_constant_inputs(experiments, constant)
        return _excitation_messages(experiments, needed)
    stepping = {j for j in constant if any(e.u[:, j].any() for e in experiments)}
    _refuse_constant_inputs(experiments, constant - stepping)
    messages = [_step_message(experiments, j) for j in sorted(stepping)]
    # a step excites all frequencies: more rows of rest before it than the model has orders show that
    before = max((*needed, 1))
    with_rest = after_rest(experiments, before)
    return messages + _excitation_messages(with_rest, needed)


def _excitation_messages(experiments: Sequence[IOData], needed: Sequence[int]) -> list[str]:
    """Messages on inputs that excite less than the `needed` orders, and on dependent ones."""
    nu, shortest = experiments[0].nu, min(len(e) for e in experiments)
    # at least as many rows as columns
    lags = min(max((*needed, 1)), shortest // (nu + 1))
    joint: FloatArray | None = None
    if nu > 1 and lags >= 1:
        # lags of all inputs, each of unit size, inputs side by side
        sizes = _sizes([e.u for e in experiments])
        joint = hankel_moments([e.u / sizes for e in experiments], lags)
    messages = _poorly_excited(experiments, needed, joint)
    if joint is not None:
        messages += _dependent_inputs(experiments[0].input_names or (), joint)
    return messages


def _sizes(signals: Sequence[FloatArray]) -> FloatArray:
    """Root mean square of each channel (nu,) of all experiments."""
    squares = sum(np.einsum("ij,ij->j", signal, signal) for signal in signals)
    return np.sqrt(squares / sum(map(len, signals)))


def after_rest(experiments: Sequence[IOData], rows: int) -> tuple[IOData, ...]:
    """Experiments with a time at rest before them: rows of zero inputs and outputs."""
    with_rest = []
    for e in experiments:
        u = np.vstack((np.zeros((rows, e.nu)), e.u))
        y = np.vstack((np.zeros((rows, e.ny)), e.y))
        with_rest.append(replace(e, u=u, y=y))
    return tuple(with_rest)


def _step_message(experiments: Sequence[IOData], j: int) -> str:
    """Warning of what a constant input from rest cannot tell."""
    name = (experiments[0].input_names or ())[j]
    return (
        f"input {name} is constant: that the system was at rest at zero before, and the input stepped at the first "
        "sample, is an assumption that this record cannot check; an earlier step reads as a shorter delay, another "
        "level of rest as another gain. A record that begins before the step would tell"
    )


def constant_inputs(experiments: Sequence[IOData]) -> set[int]:
    """Inputs that are constant in every experiment."""
    constant = set()
    for j in range(experiments[0].nu):
        if all(_is_constant(e.u[:, j]) for e in experiments):
            constant.add(j)
    return constant


def _refuse_constant_inputs(experiments: Sequence[IOData], constant: set[int]) -> None:
    for j in sorted(constant):
        name = (experiments[0].input_names or ())[j]
        values = [e.u[0, j] for e in experiments]
        advice = ""
        if any(values):
            advice = (
                "; if the system was at rest with zero input before the record, initial_conditions='zero' of procest, "
                "tfest, oe, armax, bj and polyest takes it as a step at the first sample"
            )
        shown = ", ".join(f"{value:g}" for value in values)
        raise SysidError(
            f"input {name} is constant ({shown}), which identifies nothing; expected a varying input{advice}"
        )


def _refuse_constant_outputs(experiments: Sequence[IOData]) -> None:
    for i, name in enumerate(experiments[0].output_names or ()):
        known_outputs = [e.y[e.known[:, i], i] for e in experiments]
        if all(_is_constant(y) for y in known_outputs if len(y)):
            raise SysidError(f"output {name} is constant, which identifies nothing; expected a varying output")


def _is_constant(signal: FloatArray) -> bool:
    """Whether a signal varies by rounding alone."""
    return bool(np.ptp(signal) <= ROUNDING * np.abs(signal).max())


def _poorly_excited(experiments: Sequence[IOData], needed: Sequence[int], joint: FloatArray | None) -> list[str]:
    """Messages on inputs that excite less than the `needed` orders; `joint` are moments of all inputs, if known."""
    nu, shortest = experiments[0].nu, min(len(e) for e in experiments)
    messages: list[str] = []
    for j, name in enumerate(experiments[0].input_names or ()):
        # higher orders need more lags than the shortest record has rows for
        testable = min(needed[j], shortest // 2)
        if testable < 1:
            continue
        moments: FloatArray | None = None
        if joint is not None and len(joint) == testable * nu:
            moments = joint[j::nu, j::nu]
        excited = _order_of_excitation([e.u[:, j] for e in experiments], testable, moments=moments)
        if excited < needed[j]:
            text = (
                f"input {name} is persistently exciting of order {excited} only, the model needs {needed[j]}: "
                "some parameters are determined by noise alone"
            )
            messages.append(Message(text, POORLY_EXCITED))
    return messages


def _dependent_inputs(names: Sequence[str], joint: FloatArray) -> list[str]:
    """Message on inputs whose lags have a smaller rank together, by their joint moments, than one by one."""
    nu = len(names)
    lags = len(joint) // nu
    together = _gram_rank(joint)
    one_by_one = sum(_gram_rank(joint[j::nu, j::nu]) for j in range(nu))
    if together >= one_by_one:
        return []
    subject = "the inputs" if lags == 1 else f"{lags} lags of the inputs"
    return [
        f"{subject} {', '.join(names)} have rank {together} together and {one_by_one} one by one: they are "
        "dependent, and the data cannot separate their effects"
    ]


ROWS_PER_COEFFICIENT = 5  # least number of samples per coefficient of the models that test for an offset
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
    finding = _dominant_means(experiments)
    if not finding:
        return []
    if not experiments[0].nu:
        return [f"{finding}, as a slow pole that the series need not have; {ADVICE}"]
    messages = []
    for i, name in enumerate(experiments[0].output_names or ()):
        offset = _unexplained_offset(experiments, i, order)
        if offset:
            messages.append(
                f"{finding} and does not fit the dynamics: output {name} has an offset of about {offset:.4g} that "
                f"the model lacks; {ADVICE}"
            )
    return messages


def _unexplained_offset(experiments: Sequence[IOData], output: int, order: int) -> float:
    """Offset of an output that ARX models need, of the samples or of means over several; 0 if they need none."""
    # a model that is too small, or biased by output noise, may miss the gain at 0 Hz: a longer one must agree
    offset, certainty = _missing_offset(experiments, output, order)
    longer_offset, longer_certainty = _missing_offset(experiments, output, max(order, LONGER))
    noise_free = np.isnan(longer_certainty)
    if noise_free:
        # without noise the longer model can difference the data: then the first must be exact
        longer_offset, longer_certainty = (offset, certainty) if certainty > EXACT else (0.0, 0.0)
    y = _concatenated([e.y[e.window :, output] for e in experiments])
    serious = SERIOUS * max(abs(float(np.nanmean(y))), float(np.nanstd(y)))
    significant = min(certainty, longer_certainty) > CERTAIN
    large = min(abs(offset), abs(longer_offset)) > serious
    if significant and large and offset * longer_offset > 0.0:
        return offset
    if noise_free or min(len(e) for e in experiments) < AVERAGED * FEWEST:
        return 0.0
    # noise hides what a slow process does from one sample to the next
    return _unexplained_offset([_averaged_record(e) for e in experiments], output, order)


def _averaged_record(experiment: IOData) -> IOData:
    """Means over `AVERAGED` samples as a record; an incomplete last one is left out."""
    return replace(
        experiment,
        u=_block_means(experiment.u),
        y=_block_means(experiment.y),
        dt=AVERAGED * experiment.dt,
        window=experiment.window // AVERAGED,
    )


def _block_means(signals: FloatArray) -> FloatArray:
    blocks = len(signals) // AVERAGED
    means: FloatArray = signals[: blocks * AVERAGED].reshape(blocks, AVERAGED, -1).mean(axis=1)
    return means


ADVICE = "detrend first: data.detrend()"


def large_means(experiments: Sequence[IOData]) -> list[str]:
    """Describe channels whose mean exceeds their standard deviation, for frequency-domain methods."""
    finding = _dominant_means(experiments)
    return [f"{finding} and leaks into low frequencies; {ADVICE}"] if finding else []


def _dominant_means(experiments: Sequence[IOData]) -> str:
    """Beginning of a message on the channels whose mean exceeds their standard deviation; empty without any."""
    first = experiments[0]
    inputs = _concatenated([e.u[e.window :] for e in experiments])
    outputs = _concatenated([e.y[e.window :] for e in experiments])
    means, deviations = [], []
    for channel in (*inputs.T, *outputs.T):
        samples = channel[np.isfinite(channel)]
        # one channel after the other: a mean along rows of few columns costs several times as much
        mean = float(samples.mean()) if len(samples) else 0.0
        means.append(mean)
        deviations.append(float(np.linalg.norm(samples - mean)) / np.sqrt(max(len(samples), 1)))
    names = (*(first.input_names or ()), *(first.output_names or ()))
    dominated = []
    for name, mean, deviation in zip(names, means, deviations, strict=True):
        if abs(mean) > deviation:
            dominated.append(f"{name} (mean {mean:.4g}, standard deviation {deviation:.4g})")
    return f"the mean dominates {', '.join(dominated)}" if dominated else ""


def _concatenated(signals: Sequence[FloatArray]) -> FloatArray:
    """Signals of several experiments one after the other; a single one is not copied."""
    return signals[0] if len(signals) == 1 else np.concatenate(signals)


def _missing_offset(experiments: Sequence[IOData], output: int, order: int) -> tuple[float, float]:
    """Offset that an ARX model of an output lacks, in its units and in standard deviations of the constant.

    With A y = B u + constant, the output is off by constant / A(1), A at 0 Hz. Zeros if there are too few data, NaN if
    the constant depends on the other columns.
    """
    nu = experiments[0].nu
    usable = sum(len(e) - e.window for e in experiments)
    shortest = min(len(e) for e in experiments)
    n = min(max(order, 1), usable // (ROWS_PER_COEFFICIENT * (1 + nu)), shortest // 2)
    if n < 1:
        return 0.0, 0.0
    starts = [max(n, e.window) for e in experiments]
    y, u = [e.y[:, output] for e in experiments], [e.u for e in experiments]
    # inputs with their present sample: a direct term must not look like an offset
    phi, target = arx_equations(y, u, n, (n + 1,) * nu, (0,) * nu, starts)
    complete = np.isfinite(phi).all(axis=1) & np.isfinite(target)
    phi, target = phi[complete], target[complete][:, None]
    if len(phi) <= phi.shape[1] + 1:
        return 0.0, 0.0
    with_constant = np.column_stack((phi, np.ones(len(phi))))
    fit = solve(with_constant, target)
    if fit.rank < with_constant.shape[1] and fit.rank == solve(phi, target).rank:
        return np.nan, np.nan
    constant = float(fit.solution[-1, 0])
    variance = float(fit.residual_gram[0, 0]) / (len(phi) - with_constant.shape[1])
    deviation = float(np.sqrt(variance * fit.inverse_gram[-1, -1]))
    a_at_dc = 1.0 + float(fit.solution[:n, 0].sum())
    # an integrator turns the constant into a drift, not into an offset
    if a_at_dc == 0.0:
        return 0.0, 0.0
    return constant / a_at_dc, abs(constant) / max(deviation, np.finfo(float).tiny)

"""Test whether the residuals of a linear model depend on the input nonlinearly, and on what kind of nonlinearity.

Orders that grow do not help against dry friction, play or saturation: the residuals may be white and uncorrelated with
the input all the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.model_forms import AnyModel, as_model
from sysid.models.predict import aligned, output, predict, residuals
from sysid.models.state_space import StateSpace
from sysid.polynomial.correlation import autoregression
from sysid.polynomial.regressors import lagged
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, complete_parts
from sysid.records.errors import SysidError
from sysid.records.printing import AT_ZERO
from sysid.records.singular_values import svd
from sysid.validation.joint_nonlinearity import FRICTION, PARAMETERS, PLAY, SATURATION, stop, told_kind

LAGS = 20  # of the inputs beside the tested terms: what depends linearly on the input is left to them
SLOW_LAGS = (10.0, 20.0, 40.0, 80.0, 160.0)  # samples, time constants of what reaches further back than they do
WHITENER = 25  # order of the autoregressive model of the residuals, at most
LONGEST = 20_000  # samples that are tested: more would find what does not matter
MATERIAL = 0.005  # nonlinear part of the output, relative to its deviation, from which on bandwidths go wrong
TRACE = 1e-4  # the same of commands of one amplitude, which show little of what another amplitude would change
VARIED = 0.1  # part of the cube of a command that is no multiple of it, from which on its amplitude varies
DEPENDENT = 1e-4  # singular value of the tested terms, relative to the largest, below which coefficients mean nothing

PLAY_WIDTHS = (0.02, 0.05, 0.1, 0.2, 0.4)  # half of the gap, relative to the largest deviation of the output
FRICTION_WIDTHS = (0.01, 0.05, 0.15, 0.3)  # presliding displacement, likewise
STEEPNESS = 0.1  # velocity, relative to its deviation, up to which dry friction is taken to change smoothly
ASYMMETRY = "asymmetry"
RESPONDS = 0.02  # response to a pulse, relative to its largest value, before which time is dead
DOMINANT = 2.0  # part that hysteresis explains, over that of other terms, from which on it is named


@dataclass(frozen=True, eq=False)
class NonlinearityTest(Locked):
    """Dependence of residuals on the input by nonlinear terms.

    Attributes:
        p_values: Of the hypothesis that no nonlinear term explains residuals of an output (ny,), the least of all terms
            times their number; NaN where the record is too short to test.
        distortion: Nonlinear part of every output, its deviation relative to that of the output (ny,).
        kinds: What each output's residuals look like: "dry friction", "play", "saturation", "dry friction or play", or
            empty where that cannot be told.
        varies: Whether the input that moves the output most varies in amplitude (ny,). Of commands between two levels
            a static nonlinearity makes commands between two others, as a gain does: `distortion` then says little about
            how far gain and bandwidth depend on the amplitude.
        level: Confidence level.
        hidden: "dry friction" or "play" where commands of one amplitude show no material nonlinearity in the residuals,
            and yet a servo with that explains the record far better than a linear one; else empty (ny,).
    """

    p_values: FloatArray
    distortion: FloatArray
    kinds: tuple[str, ...]
    varies: tuple[bool, ...]
    level: float
    hidden: tuple[str, ...]

    @property
    def material(self) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Whether nonlinearity is significant at the level and large enough to matter, per output (ny,)."""
        least = np.where(self.varies, MATERIAL, TRACE)
        return np.asarray((self.p_values < 1.0 - self.level) & (self.distortion >= least))


def nonlinearity(
    model: AnyModel, data: Sequence[IOData], *, level: float = 0.999, named: bool = True
) -> NonlinearityTest | None:
    """Test the prediction errors of a stable linear model for nonlinear dependence on the input.

    Terms of the simulated output and of the input (hysteresis of dry friction and play, cubes, squares) pass through
    the model's path from the input where the nonlinearity acts before the dynamics, then through its predictor and a
    whitener of the errors. Each is tested by an F test beside `LAGS` lags of the inputs, and inputs behind slower lags:
    a linear response that the model lacks is no nonlinearity. Correlations with squares of inputs and residuals have
    the same purpose [Billings2013, sec. 5.2]. Terms depend on past inputs alone, so that feedback makes no
    nonlinearity.

    Args:
        model: The model, in any form that `predict` takes.
        data: Records of its fit, about its operating point.
        level: Confidence level; of all terms together.
        named: Whether to tell kinds, which takes most of the time; empty without.

    Returns:
        The test; None for an unstable model.
    """
    first = data[0]
    model = aligned(as_model(model, first), first)
    if not model.is_stable():
        return None
    records = _tested_parts(data)
    p_values, distortion = np.full(first.ny, np.nan), np.zeros(first.ny)
    kinds, hidden = [""] * first.ny, [""] * first.ny
    varies = [True] * first.ny
    for i in range(first.ny):
        try:
            terms = [_terms(model, record, i) for record in records]
        except SysidError:  # channels that overflow
            continue
        if not terms:
            continue
        outcome = _tested(model, terms, i)
        if outcome is None:
            continue
        p_values[i], distortion[i], explained = outcome
        varies[i] = any(_varies(of_record.record.u[:, of_record.main]) for of_record in terms)
        if not named:
            continue
        is_significant = p_values[i] < 1.0 - level
        if is_significant and distortion[i] >= MATERIAL:
            kinds[i] = _kind(model, terms[0], explained)
        elif not varies[i] and not (is_significant and distortion[i] >= TRACE):
            kind = _kind_of_joint(model, terms[0], beside_model=True)
            # beside saturation the linear model of a record is that of its servo
            hidden[i] = kind if kind in (FRICTION, PLAY) else ""
    return NonlinearityTest(p_values, distortion, tuple(kinds), tuple(varies), level, tuple(hidden))


@dataclass(frozen=True, eq=False)
class _Terms:
    """What is regressed for one output of one record.

    Attributes:
        record: The record.
        errors: Prediction errors of the output (N,).
        target: Output less what other inputs than the main one contribute (N,).
        output: Number of the output.
        main: Number of the input that moves the output most.
        families: Family of every term.
        terms: The terms, each of unit deviation or zero (N, terms).
    """

    record: IOData
    errors: FloatArray
    target: FloatArray
    output: int
    main: int
    families: tuple[str, ...]
    terms: FloatArray


def _tested_parts(data: Sequence[IOData]) -> list[IOData]:
    """Parts without gaps, the longest first, together at most `LONGEST` samples."""
    parts = complete_parts(data)
    parts.sort(key=len, reverse=True)
    kept, room = [], LONGEST
    for part in parts:
        if min(len(part), room) >= 4 * (LAGS + WHITENER):
            kept.append(part[:room])
            room -= len(kept[-1])
    return kept


def _varies(command: FloatArray) -> bool:
    """Whether a command (N,) varies in amplitude about its mean: whether its cube is more than a multiple of it."""
    centred = command - command.mean()
    cube = centred**3
    rest = _without(centred[:, None], cube[:, None])
    return bool(rest.std() > VARIED * cube.std())


def _terms(model: StateSpace, record: IOData, i: int) -> _Terms:
    """Nonlinear terms of an output of a record."""
    simulated = predict(model, record, steps=None)
    errors = residuals(model, record)[:, i]
    path = model.input_path()
    contributions = []
    for j in range(model.nu):
        alone = np.zeros_like(record.u)
        alone[:, j] = record.u[:, j] - record.u[0, j]
        contributions.append(output(path, alone, np.zeros(path.order))[:, i])
    main = int(np.argmax([contribution.std() for contribution in contributions]))
    if not np.isfinite(simulated).all() or not np.isfinite(errors).all():
        raise SysidError("the simulation overflows")
    others = sum(contribution for j, contribution in enumerate(contributions) if j != main)
    u, y = record.u[:, main], simulated[:, i]

    def through_path(signal: FloatArray) -> FloatArray:
        inputs = np.zeros_like(record.u)
        inputs[:, main] = signal - signal[0]
        return output(path, inputs, np.zeros(path.order))[:, i]

    gain = float(model.dc_gain()[i, main])
    columns = _columns(u, y - y.mean(), gain, through_path)
    families = tuple(family for family, _ in columns)
    terms = np.column_stack([column for _, column in columns])
    terms -= terms.mean(axis=0)
    sizes = terms.std(axis=0)
    terms = np.where(sizes > 0.0, terms / np.where(sizes > 0.0, sizes, 1.0), 0.0)
    return _Terms(record, errors, record.y[:, i] - others, i, main, families, terms)


def _columns(
    u: FloatArray, y: FloatArray, gain: float, through_path: Callable[[FloatArray], FloatArray]
) -> list[tuple[str, FloatArray]]:
    """Terms with their families: of the input u (N,) and the simulated output y (N,), which has no mean."""
    reach = float(np.abs(y).max()) or 1.0
    # the velocity of the past alone: a central difference would need the next input, which feedback makes of the error
    velocity = np.diff(y, prepend=y[:1])
    speed = velocity / (velocity.std() or 1.0)
    command = (u - u.mean()) / (u.std() or 1.0)
    lag_of_servo = u - u.mean() - (y / gain if np.isfinite(gain) and gain else y)
    lag_of_servo = lag_of_servo / (lag_of_servo.std() or 1.0)
    columns = [(PLAY, stop(y, width * reach)) for width in PLAY_WIDTHS]
    columns += [(FRICTION, through_path(stop(y, width * reach))) for width in FRICTION_WIDTHS]
    columns.append((FRICTION, through_path(np.tanh(speed / STEEPNESS))))
    columns += [(SATURATION, through_path(command**3)), (SATURATION, (y / reach) ** 3)]
    columns += [(SATURATION, through_path(lag_of_servo**3)), (SATURATION, speed**3)]
    columns += [(ASYMMETRY, through_path(command**2)), (ASYMMETRY, (y / reach) ** 2)]
    columns.append((ASYMMETRY, through_path(np.abs(speed))))
    return columns


def _tested(model: StateSpace, terms: Sequence[_Terms], i: int) -> tuple[float, float, dict[str, float]] | None:
    """p-value, distortion of the output, and the part of the errors that the best term of each family explains."""
    errors = np.concatenate([of_record.errors for of_record in terms])
    order = max(1, min(WHITENER, len(errors) // 20))
    whitener, _ = autoregression(errors - errors.mean(), order)
    start = order + LAGS
    tested, linear, target, raw, raw_linear = [], [], [], [], []
    for of_record in terms:
        record = of_record.record
        signals = [of_record.errors[:, None], _predictor_errors(model, of_record.terms, i)]
        inputs = record.u - record.u.mean(axis=0)
        signals.append(np.column_stack([_predictor_errors(model, inputs[:, [j]], i) for j in range(record.nu)]))
        slow = _behind_lags(inputs)
        signals.append(_predictor_errors(model, slow, i))
        white = [scipy.signal.lfilter(whitener, [1.0], signal, axis=0) for signal in signals]
        target.append(white[0][start:, 0])
        tested.append(white[1][start:])
        linear.append(_lagged_inputs(white[2], white[3], start))
        raw.append(of_record.terms[start:])
        raw_linear.append(_lagged_inputs(inputs, slow, start))
    if not all(np.isfinite(part).all() for part in (*tested, *linear)):
        return None
    rest = _without(np.vstack(linear), np.column_stack((np.concatenate(target), np.vstack(tested))))
    t, columns = rest[:, 0], rest[:, 1:]
    freedom = len(t) - 1 - linear[0].shape[1] - columns.shape[1]
    size = float(np.concatenate([of_record.record.y[:, i] for of_record in terms]).std())
    # of an output that stands still no part is distortion
    if freedom < columns.shape[1] or not t.any() or size == 0.0:
        return None
    total, sizes = float(t @ t), np.sum(columns**2, axis=0)
    # a term that the lags of the inputs explain says nothing
    is_new = sizes > DEPENDENT**2 * np.sum(np.vstack(tested) ** 2, axis=0)
    explained = np.where(is_new, (columns.T @ t) ** 2 / np.where(is_new, sizes, 1.0), 0.0) / total
    best = float(explained.max())
    p = scipy.stats.f.sf(best / max(1.0 - best, np.finfo(float).eps) * freedom, 1, freedom)
    coefficients = np.linalg.lstsq(columns, t, rcond=DEPENDENT)[0]
    nonlinear = _without(np.vstack(raw_linear), (np.vstack(raw) @ coefficients)[:, None])
    families: dict[str, float] = {}
    for family, part in zip(terms[0].families, explained.tolist(), strict=True):
        families[family] = max(families.get(family, 0.0), part)
    return min(1.0, float(p) * len(explained)), float(nonlinear.std() / size), families


def _behind_lags(inputs: FloatArray) -> FloatArray:
    """Inputs (N, nu) behind lags of time constants from a few samples to a part of the record (N, nu k)."""
    responses = []
    for constant in SLOW_LAGS:
        pole = np.exp(-1.0 / constant)
        responses.append(scipy.signal.lfilter([1.0 - pole], [1.0, -pole], inputs, axis=0))
    return np.hstack(responses)


def _lagged_inputs(inputs: FloatArray, slow: FloatArray, start: int) -> FloatArray:
    """`LAGS` past values of the inputs (N, nu), and the last one of those behind slow lags, from `start` on."""
    table = [lagged(column, range(1, LAGS + 1), start) for column in inputs.T]
    return np.hstack((*table, slow[start - 1 : -1]))


def _predictor_errors(model: StateSpace, outputs: FloatArray, i: int) -> FloatArray:
    """Errors of output i that signals (N, k) would leave there as parts of the output, each by itself (N, k)."""
    errors = []
    for signal in outputs.T:
        y = np.zeros((len(signal), model.ny))
        y[:, i] = signal
        predicted = _predicted_from_outputs(model, y)
        errors.append(signal - predicted[:, i])
    return np.column_stack(errors)


def _predicted_from_outputs(model: StateSpace, y: FloatArray) -> FloatArray:
    """One-step prediction (N, ny) from outputs alone, from rest: C (q - A + K C)^-1 K y."""
    if not model.gain.any():
        return np.zeros_like(y)
    direct = np.zeros((model.ny, model.ny))
    predictor = StateSpace(model.A - model.gain @ model.C, model.gain, model.C, direct, None, model.dt)
    return output(predictor, y, np.zeros(model.order))


def _without(explaining: FloatArray, signals: FloatArray) -> FloatArray:
    """What signals (N, k) have beyond a constant and explaining ones (N, m)."""
    centred = explaining - explaining.mean(axis=0)
    basis, values, _ = svd(centred, full_matrices=False)
    basis = basis[:, values > 1e-8 * max(values[0], np.finfo(float).tiny)]
    signals = signals - signals.mean(axis=0)
    return np.asarray(signals - basis @ (basis.T @ signals))


def _kind(model: StateSpace, terms: _Terms, explained: dict[str, float]) -> str:
    """Kind of nonlinearity, by small models of joints that differ in it; else hysteresis if it explains the most."""
    kind = _kind_of_joint(model, terms)
    if kind:
        return kind
    hysteresis = max(explained[PLAY], explained[FRICTION])
    if hysteresis > DOMINANT * max(explained[SATURATION], explained[ASYMMETRY]):
        return f"{FRICTION} or {PLAY}"
    return ""


def _kind_of_joint(model: StateSpace, terms: _Terms, *, beside_model: bool = False) -> str:
    """Kind of nonlinearity by small models of joints that differ in it; empty where they do not tell one.

    With `beside_model` the model itself counts too, if it has no more parameters than a joint: a lag behind a delay is
    no servo of second order.
    """
    record = terms.record
    path = model.input_path().channel(terms.main, terms.output)
    response = np.abs(path.markov(LAGS)[:, 0, 0])
    # the dead time ends where the response to a pulse is no longer a small part of its largest value
    delay = max(int(np.argmax(response >= RESPONDS * response.max())) - 1, 0)
    bandwidth = float(path.bandwidth()[0, 0])
    simulated = None
    parameters = 1 + np.count_nonzero(np.abs(path.poles()) > AT_ZERO) + len(path.zeros())
    if beside_model and parameters <= PARAMETERS:
        simulated = terms.target - (record.y - predict(model, record, steps=None))[:, terms.output]
    return told_kind(record.u[:, terms.main], terms.target, record.dt, delay, bandwidth, simulated)

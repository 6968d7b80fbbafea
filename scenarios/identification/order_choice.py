"""Identification without method or orders: the toolbox chooses them, the last part of the record judges the model."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy.signal

import sysid
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.identification import Identification, identify
from scenarios.identification.methods import ESTIMATORS
from sysid import IOData, StructureChoice, SysidError
from sysid.models.continuous_estimate import sampled_poles
from sysid.models.predict import predict
from sysid.models.static_gain import gain_told_by
from sysid.polynomial.fit_with_offset import subtract_means
from sysid.records.arrays import FloatArray
from sysid.records.data import complete_parts
from sysid.selection import choose_impulseest, choose_procest, choose_tfest
from sysid.selection.slow_modes import slow_radius
from sysid.selection.structure_search import ORDERS, largest_ratio

CHOSEN = (*ORDERS, "tfest", "procest", "impulseest")
"""Methods whose orders can be chosen."""

HELD_OUT = 0.25
"""Part of a record that judges the model, its end."""

STEADY = 0.02
"""Deviation of an input in the held-out part, relative to that in the record, up to which it does not move there."""

LOOKED_AT_AGAIN = 4000
"""Samples of all records up to which a slow mode is looked for in all of them."""

CLOSE = 0.2
"""Part by which gains at 0 Hz of the chosen model and of a discrete one may differ."""

ALIKE = 0.2
"""Least common power of an input in the part held out and before it. Random and binary inputs, tones and steps that
repeat have 0.5 and more, chirps over the whole record at most 0.05."""

LEAST_SEGMENT, MOST_SEGMENT = 32, 1024
"""Samples of the segments of these spectra."""

SHORTEST = 400
"""Samples of the longest record from which on a part is held out; fewer are needed for the choice."""


FAR_WORSE = 2.0
"""Ratio of the sums of squared simulation errors from which on another model is far better."""


def choose_and_identify(
    records: Sequence[IOData],
    method: str | None,
    *,
    keep_mean: bool = False,
    offset: bool | None = None,
    trend: bool | None = None,
    direct: bool = False,
    steps: int = 1,
    check: Sequence[IOData] | None = None,
    continued: bool = False,
    whole: Sequence[IOData] | None = None,
) -> tuple[Identification, StructureChoice]:
    """Choose structure, delay and orders, fit the model with its operating point, and judge it.

    Args:
        records: Records to estimate from, as `usable` returns them.
        method: One of `CHOSEN`; None tries arx, armax, oe and bj.
        keep_mean: Whether to take values as they are, without an operating point.
        offset: Whether the output has a constant beside its mean; None lets the choice decide.
        trend: Whether it has a straight line, likewise.
        direct: Whether the output may depend on the input of the same sample although the data have noise.
        steps: Horizon of the further prediction, samples.
        check: Records to judge on; `records` when None.
        continued: Whether these continue the records.
        whole: Records of which `records` and `check` are parts, from which the model is estimated again after it was
            judged; None leaves it as it was judged.

    Raises:
        ScenarioError: An unknown method, or one whose orders are not chosen.
        SysidError: The records are refused, or nothing could be fitted.
    """
    if method is not None and method not in ESTIMATORS:
        raise ScenarioError(unknown("method", method, ESTIMATORS))
    if method is not None and method not in CHOSEN:
        raise ScenarioError(f"--method {method} needs --orders; they are chosen for {', '.join(CHOSEN)}")
    if method is not None and method not in ORDERS and trend:
        raise ScenarioError(f"{method} has no trend; expected one of {', '.join(ORDERS)}")
    if method == "impulseest" and offset:
        raise ScenarioError(f"impulseest has no offset; expected one of {', '.join((*ORDERS, 'tfest', 'procest'))}")
    if method is not None and method not in ORDERS and direct:
        raise ScenarioError(f"--direct is not of {method}; expected one of {', '.join(ORDERS)}")
    # with the options of the caller, asked more than once
    discrete = partial(_discrete, method=method, keep_mean=keep_mean, offset=offset, trend=trend, direct=direct)
    with warnings.catch_warnings():
        # They are of candidates; those of the chosen model come with its identification.
        warnings.simplefilter("ignore", sysid.SysidWarning)
        choice = _choice(records, method, discrete, keep_mean=keep_mean)
        # a slow mode that the part estimated from hides may show in all samples; of one output alone it is looked for
        is_short = whole is not None and whole[0].ny == 1 and sum(map(len, whole)) <= LOOKED_AT_AGAIN
        if whole is not None and is_short and not choice.cautions:
            slower = discrete(whole).slower
            choice = replace(choice, cautions=(slower,) if slower else ())
        result = identify(
            records,
            *_chosen(choice),
            keep_mean=keep_mean,
            trend=choice.candidates[0].trend_options,
            weighting=choice.candidates[0].weighting,
            found=choice.estimate,
            steps=steps,
            check=check,
            continued=continued,
            whole=whole,
        )
    result = replace(
        result,
        cautions=choice.cautions,
        disagreement=choice.disagreement,
        same_sample=choice.same_sample,
        chose_trend=method is None or method in ORDERS,
    )
    return result, choice


def _choice(
    records: Sequence[IOData],
    method: str | None,
    discrete: Callable[[Sequence[IOData]], StructureChoice],
    *,
    keep_mean: bool,
) -> StructureChoice:
    """The choice, on the records about their means; `discrete` is that of `auto`."""
    if method is None or method in ORDERS:
        return discrete(records)
    about = records if keep_mean else subtract_means(records)
    if method == "tfest":
        choice = choose_tfest(about, offset=not keep_mean)
    elif method == "procest":
        choice = choose_procest(about, offset=not keep_mean)
    else:
        choice = choose_impulseest(about)
    if choice.estimate.model.ny > 1:
        return choice
    try:
        beside = discrete(records)
    except SysidError:
        return choice
    return _beside_discrete(choice, beside, about)


def _discrete(
    records: Sequence[IOData],
    *,
    method: str | None,
    keep_mean: bool,
    offset: bool | None,
    trend: bool | None,
    direct: bool,
) -> StructureChoice:
    """The choice of `auto` on the records about their means: of one of its methods, or of all where it has it not."""
    about = records if keep_mean else subtract_means(records)
    if keep_mean:
        offset, trend = False, False
    methods = None if method is None or method not in ORDERS else [method]
    return sysid.auto(about, methods=methods, offset=offset, trend=trend, direct=direct)


def _beside_discrete(choice: StructureChoice, beside: StructureChoice, records: Sequence[IOData]) -> StructureChoice:
    """A choice with what the one of discrete models, with models of the disturbance, says against it.

    Errors weighted by their colour take a slow part of the response for noise: a slower model that fits better, or one
    with another gain, makes it a caution.
    """
    estimate = choice.estimate
    objection, best = beside.slower, beside.candidates[0]
    if not beside.cautions:
        samples, dt = max(map(len, records)), records[0].dt
        radius = slow_radius(samples)
        gains, others = (gain_told_by(model, dt, samples) for model in (estimate, beside.estimate))
        ratio = largest_ratio([np.abs(gains).ravel(), np.abs(others).ravel()])
        if np.isfinite(best.drive) and not (np.abs(sampled_poles(estimate)) > radius).any():
            objection = f"{best} has a mode slower than a third of the record, which this model lacks"
        elif ratio > 1.0 + CLOSE and not _simulates_far_worse(beside.estimate, estimate, records):
            listed = ", ".join(f"{gain:.4g}" for gain in np.ravel(others))
            objection = f"{best}, chosen among discrete models, has a gain at 0 Hz of {listed}: methods disagree"
        elif _simulates_far_worse(estimate, beside.estimate, records):
            objection = f"{best}, chosen among discrete models, simulates far better: the method lacks its structure"
    if not objection:
        return choice
    return replace(choice, cautions=(*choice.cautions, objection), slower=beside.slower)


def _simulates_far_worse(estimate: sysid.Estimate, other: sysid.Estimate, records: Sequence[IOData]) -> bool:
    """Whether a model leaves far more of the outputs in simulation than another; not if one of them integrates."""
    paths = estimate.model.input_path(), other.model.input_path()
    if not all(path.is_stable() for path in paths):
        return False
    errors = [_simulation_error(path, records) for path in paths]
    return errors[0] > FAR_WORSE * errors[1]


def _simulation_error(path: sysid.StateSpace, records: Sequence[IOData]) -> float:
    """Sum of squares that a path from the input leaves of the outputs, beside a line in each."""
    total = 0.0
    for part in complete_parts(records):
        errors = part.y - predict(path, part, steps=None)
        # constants and drifts are the operating point's
        total += float(np.sum(scipy.signal.detrend(errors, axis=0) ** 2))
    return total


def _chosen(choice: StructureChoice) -> tuple[str, list[Any]]:
    """Method and orders of the best candidate, in the sequence of its estimator."""
    best = choice.candidates[0]
    estimator = ESTIMATORS[best.method]
    return best.method, [best.orders[name] for name in (*estimator.orders, *estimator.optional)]


def hold_out(
    records: tuple[IOData, ...], share: float = HELD_OUT, *, is_asked_for: bool = False
) -> tuple[tuple[IOData, ...], tuple[IOData, ...] | None]:
    """Records to estimate from, and the end of the longest one, which judges the model; None if it cannot.

    It cannot where the record is too short, or where no input moves in it. Unless it is asked for, it does not where it
    or the rest alone tells too little: an input moves at other frequencies in it than before, as a chirp does, or not
    before it, or one of several outputs hardly moves in it. The samples before it, as many as it has, give the state
    from which it is simulated: one fitted to the judged samples would follow any drift.

    Args:
        records: All records.
        share: Part of the longest one that is held out.
        is_asked_for: Whether the part was asked for.
    """
    longest = max(range(len(records)), key=lambda k: len(records[k]))
    # So short a record is needed whole for the choice; it then judges its own model.
    if len(records[longest]) < SHORTEST:
        return records, None
    whole = records[longest]
    end = round((1.0 - share) * len(whole))
    moving = np.flatnonzero(whole.u[end:].std(axis=0) > STEADY * whole.u.std(axis=0))
    spread = np.nanmax(whole.y[end:], axis=0) - np.nanmin(whole.y[end:], axis=0) if whole.known[end:].any() else 0.0
    # no fit is defined to an output that stays where it is
    if not len(moving) or not np.all(spread > 0.0):
        return records, None
    to_estimate = list(records)
    to_estimate[longest] = whole[:end]
    if not is_asked_for:
        # Of several outputs one may rest there while others move: its fit would be that to noise.
        stay = np.nanstd(whole.y[end:], axis=0) <= STEADY * np.nanstd(whole.y, axis=0)
        if whole.ny > 1 and stay.any():
            return records, None
        for j in moving.tolist():
            if _common_power([record.u[:, j] for record in to_estimate], whole.u[end:, j]) < ALIKE:
                return records, None
    before = min(end, len(whole) - end)
    return tuple(to_estimate), (replace(whole[end - before :], window=before),)


def _common_power(before: Sequence[FloatArray], end: FloatArray) -> float:
    """Part of the power of an input (N_i,) that lies at the same frequencies in two parts; 0 if the first is constant.

    The sum of the smaller one of two spectra [Welch1967], each of unit power: 1 for equal spectra, 0 for those that
    exclude each other.
    """
    length = int(np.clip(len(end) // 4, LEAST_SEGMENT, MOST_SEGMENT))
    of_end = _power_spectrum(end, length)
    of_rest = np.zeros_like(of_end)
    for u in before:
        of_rest += len(u) * _power_spectrum(u, length)
    if not of_rest.any():
        return 0.0
    return float(np.minimum(of_rest / of_rest.sum(), of_end / of_end.sum()).sum())


def _power_spectrum(u: FloatArray, length: int) -> FloatArray:
    _, power = scipy.signal.welch(u, nperseg=min(length, len(u)), nfft=length, detrend="constant")
    # a constant has no power but for rounding
    return np.zeros_like(power) if np.ptp(u) == 0.0 else np.asarray(power)

"""Chapter V's analysis: Markov parameters, prediction errors, singular values and realisations of observers.

The observer has p = 5 Markov parameters and the model two states for every joint, as in the thesis [Morris1996, ch. V].
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sysid
from hmtb_twin import STUDIED_JOINTS, Truth
from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis import estimates
from scenarios.thesis.campaign import Campaign, StudyRecords
from sysid import Estimate, IOData, ModelFit, ResidualTest, SysidWarning

P = 5
"""Observer Markov parameters of the thesis [Morris1996, sec. V.2A]."""

ORDER = 2
"""States per joint of the thesis [Morris1996, sec. V.2B]."""

NUMBERS = (1, 2, 3, 4, 5, 6, 8, 10)
"""Numbers of observer Markov parameters whose prediction errors are compared."""

CHIRP = 8
"""Number of the single-joint test that the thesis cross-validates its observers on."""

LIVE = 0.05
"""A Markov parameter below this fraction of the largest counts as zero."""

SEVERAL = ("mimo-7", "mimo-7-independent")
"""PRBS tests of three joints: one waveform on every axis, and one of its own on each."""


@dataclass(frozen=True)
class ObserverError:
    """Standard deviations of an observer's errors, relative to that of the output.

    Attributes:
        p: Observer Markov parameters.
        prediction: Of the prediction from p samples before.
        smoothing: Of the estimate from p samples before and p after.
    """

    p: int
    prediction: float
    smoothing: float


@dataclass(frozen=True)
class Share:
    """Share of the response that a number of states carries, in three measures.

    Attributes:
        order: Number of states.
        squared: The thesis' measure: percent of the squared Hankel singular values.
        unsquared: Percent of the singular values themselves.
        simulation: Fit of the model of that order to the record in simulation, percent.
        one_step: The same one step ahead.
    """

    order: int
    squared: float
    unsquared: float
    simulation: float
    one_step: float


@dataclass(frozen=True, eq=False)
class JointObserver:
    """The observer of one joint from the PRBS test.

    Attributes:
        estimate: The model.
        test: Residual test on its own record: K = -G is a Kalman gain only where the residuals are white.
        true_markov: Markov parameters of the small-signal truth (K,), as many as the estimate's.
        live: Number of system Markov parameters before the response has died away, and of the observer's.
        shares: What one to five states hold.
        errors: Prediction errors over the number of observer Markov parameters; none unless the study is thorough.
        own: Fits to its own record, with the traces.
        chirp: Fits to the 5-10 Hz chirp, test 8; None where there is no such record.
    """

    estimate: Estimate
    test: ResidualTest
    true_markov: NDArray[np.float64]
    live: tuple[int, int]
    shares: tuple[Share, ...]
    errors: tuple[ObserverError, ...]
    own: ModelFit
    chirp: ModelFit | None

    @property
    def observer_poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A + G C, largest modulus first; all at the origin for a deadbeat observer."""
        model = self.estimate.model
        values = np.linalg.eigvals(model.A - model.gain @ model.C).astype(complex)
        return values[np.argsort(-np.abs(values), kind="stable")]


@dataclass(frozen=True, eq=False)
class RecordObserver:
    """The observer from one single-joint record.

    Attributes:
        test: Number of the test.
        estimate: The model.
        squared: Percent of the squared Hankel singular values that two states hold.
        unsquared: The same of the singular values.
        bandwidth_hz: Bandwidth; NaN where there is none.
        simulation: Fit to its own record in simulation, percent.
        one_step: The same one step ahead.
        prbs: Fit in simulation to the record of the estimation test, percent.
        whiteness_p: Of the residuals on its own record.
    """

    test: int
    estimate: Estimate
    squared: float
    unsquared: float
    bandwidth_hz: float
    simulation: float
    one_step: float
    prbs: float
    whiteness_p: float


@dataclass(frozen=True, eq=False)
class SeveralObserver:
    """The observer of three joints at once.

    Attributes:
        name: Name of the record.
        estimate: The model, two states for each joint.
        condition: Condition number of the regressors, columns scaled.
        squared: Percent of the squared Hankel singular values that its states hold.
        unsquared: The same of the singular values.
        own: Fits in simulation to its own record, percent (3,).
        own_one_step: The same one step ahead (3,).
        other: Fits in simulation to the other record of `SEVERAL` (3,); NaN where there is none.
        error: Relative error of its response against the truth, 0.5 to 10 Hz.
        diagonal_error: The same of the diagonal alone.
    """

    name: str
    estimate: Estimate
    condition: float
    squared: float
    unsquared: float
    own: NDArray[np.float64]
    own_one_step: NDArray[np.float64]
    other: NDArray[np.float64]
    error: float
    diagonal_error: float


@dataclass(frozen=True, eq=False)
class Observers:
    """All observers of the study.

    Attributes:
        joints: From the PRBS test, by joint.
        records: From every record, by joint; empty unless the study is thorough.
        several: Of three joints at once; likewise.
    """

    joints: Mapping[str, JointObserver]
    records: Mapping[str, tuple[RecordObserver, ...]]
    several: tuple[SeveralObserver, ...]


def observers(records: StudyRecords) -> Observers:
    """Analyse the observers of the study: p = 5 and two states, from the estimation test of each joint.

    Args:
        records: Those of the study.

    Returns:
        What chapter V shows.

    Raises:
        MissingRecordError: The record of the estimation test.
    """
    with warnings.catch_warnings():
        # The diagnostics of the estimates hold the same warnings.
        warnings.simplefilter("ignore", SysidWarning)
        joints = {joint: _joint(records, joint) for joint in STUDIED_JOINTS}
        if not records.thorough:
            return Observers(joints, {}, ())
        every = {joint: _records(records.main.singles(joint), records.own(joint)) for joint in STUDIED_JOINTS}
        return Observers(joints, every, _several(records.main))


def observer_errors(data: IOData, numbers: tuple[int, ...] = NUMBERS) -> tuple[ObserverError, ...]:
    """Prediction and smoothing errors of observers, in parts of the output's standard deviation.

    The thesis does not say what its smoothing error is; it is read as that of the best linear estimate of a sample from
    p samples of input and output on both sides of it.

    Args:
        data: A record of one input and one output.
        numbers: Numbers of observer Markov parameters.

    Returns:
        A row for each.
    """
    spread = float(np.std(data.y))
    return tuple(
        ObserverError(
            p, float(np.sqrt(observer(data, 1, p).noise_variance[0, 0])) / spread, _smoothed(data, p) / spread
        )
        for p in numbers
    )


def observer(data: IOData, order: int = ORDER, p: int = P) -> Estimate:
    """An observer model; its diagnostics hold its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        return estimates.estimate(data, "okid", (order, p))


def hankel_share(estimate: Estimate, order: int, power: int = 2) -> float:
    """Share of the Hankel singular values, squared as in the thesis, in the first `order` of them, percent."""
    values = np.asarray(estimate.diagnostics["hankel_singular_values"], dtype=float) ** power
    return float(100.0 * values[:order].sum() / values.sum())


def live(markov: NDArray[np.float64]) -> int:
    """Number of Markov parameters up to the last whose size is more than `LIVE` of the largest."""
    size = np.linalg.norm(markov.reshape(len(markov), -1), axis=1)
    return int(np.flatnonzero(size > LIVE * size.max())[-1]) + 1


def _joint(records: StudyRecords, joint: str) -> JointObserver:
    own, campaign = records.own(joint), records.main
    estimate = observer(own)
    chirp = campaign.single(CHIRP, joint) if single_joint_test(CHIRP, joint) in campaign.logs else None
    system = np.asarray(estimate.diagnostics["system_markov"])
    parts = [np.asarray(estimate.diagnostics[f"observer_markov_{name}"]) for name in "uy"]
    return JointObserver(
        estimate=estimate,
        test=sysid.resid(estimate, own),
        true_markov=campaign.truth.joint(joint).model.markov(len(system))[:, 0, 0],
        live=(live(system), live(np.concatenate(parts, axis=2))),
        shares=tuple(_share(own, order) for order in range(1, P + 1)),
        errors=observer_errors(own) if records.thorough else (),
        own=sysid.compare({"OKID": estimate}, own)[0],
        chirp=None if chirp is None else sysid.compare({"OKID": estimate}, chirp)[0],
    )


def _share(data: IOData, order: int) -> Share:
    estimate = observer(data, order)
    (fit,) = sysid.compare({"OKID": estimate}, data)
    return Share(
        order,
        hankel_share(estimate, order),
        hankel_share(estimate, order, 1),
        float(fit.simulation[0]),
        float(fit.one_step[0]),
    )


def _smoothed(data: IOData, p: int) -> float:
    """Standard deviation of the error of a sample predicted from p samples of input and output on both sides."""
    around = np.lib.stride_tricks.sliding_window_view(np.hstack((data.u, data.y)), 2 * p + 1, axis=0)
    columns = np.delete(around.reshape(len(around), -1), around.shape[2] + p, axis=1)
    target = data.y[p : len(data) - p, 0]
    return float(np.std(target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]))


def _records(data: Mapping[int, IOData], prbs: IOData) -> tuple[RecordObserver, ...]:
    return tuple(_record(test, record, prbs) for test, record in data.items())


def _record(test: int, record: IOData, prbs: IOData) -> RecordObserver:
    estimate = observer(record)
    own, other = (sysid.compare({"OKID": estimate}, one)[0] for one in (record, prbs))
    return RecordObserver(
        test=test,
        estimate=estimate,
        squared=hankel_share(estimate, ORDER),
        unsquared=hankel_share(estimate, ORDER, 1),
        bandwidth_hz=float(estimate.model.bandwidth()[0, 0]),
        simulation=float(own.simulation[0]),
        one_step=float(own.one_step[0]),
        prbs=float(other.simulation[0]),
        whiteness_p=float(sysid.resid(estimate, record).whiteness_p[0]),
    )


def _several(campaign: Campaign) -> tuple[SeveralObserver, ...]:
    """Observers of three joints; a record that failed has none."""
    data: dict[str, IOData] = {}
    for name in SEVERAL:
        try:
            data[name] = campaign.several(name)
        except MissingRecordError:
            continue
    return tuple(_three_joint_observer(name, data, campaign.truth) for name in data)


def _three_joint_observer(name: str, data: Mapping[str, IOData], truth: Truth) -> SeveralObserver:
    own, states = data[name], ORDER * len(STUDIED_JOINTS)
    estimate = observer(own, states)
    fit = sysid.compare({"OKID": estimate}, own)[0]
    others = [sysid.compare({"OKID": estimate}, record)[0].simulation for key, record in data.items() if key != name]
    # Frequencies of the PRBS file at which the arm responds.
    f = np.geomspace(0.5, 10.0, 200)
    columns = [list(truth.model.input_names or ()).index(f"{joint} commanded") for joint in STUDIED_JOINTS]
    true = truth.model.frequency_response(f)[:, columns][:, :, columns]
    wrong = estimate.model.frequency_response(f) - true
    on = np.eye(len(columns), dtype=bool)
    return SeveralObserver(
        name=name,
        estimate=estimate,
        condition=float(np.asarray(estimate.diagnostics["condition"])),
        squared=hankel_share(estimate, states),
        unsquared=hankel_share(estimate, states, 1),
        own=fit.simulation,
        own_one_step=fit.one_step,
        other=others[0] if others else np.full(len(columns), np.nan),
        error=float(np.linalg.norm(wrong) / np.linalg.norm(true)),
        diagonal_error=float(np.linalg.norm(wrong[:, on]) / np.linalg.norm(true[:, on])),
    )

"""Forecast of outputs beyond the end of a record, with its uncertainty."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.delta_method import spread, standard_directions
from sysid.models.estimate import Estimate
from sysid.models.model_forms import Choice, as_model, chosen_model
from sysid.models.predict import (
    about_operating_point,
    aligned,
    as_inputs,
    fitted_state,
    initial_state,
    predictor_inputs,
)
from sysid.models.recursion import driven_output, driven_states, free_response, kalman_filter
from sysid.models.state_space import StateSpace
from sysid.records.arguments import confidence_level, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.channels import default_names
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.labelled import Labelled


@dataclass(frozen=True, eq=False, repr=False)
class Forecast(Labelled, Locked):
    """Outputs forecast from the end of a record.

    Attributes:
        time: Sampling instants in s, on the time axis of the record (steps,).
        y: Forecast outputs (steps, ny).
        covariance: Of the forecast errors of one instant (steps, ny, ny).
        output_names: One name per output.
        output_units: One unit per output.
    """

    time: FloatArray
    y: FloatArray
    covariance: FloatArray
    output_names: tuple[str, ...] = field(default=(), kw_only=True)
    output_units: tuple[str, ...] = field(default=(), kw_only=True)

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        axes = ("time", "output")
        names = self.output_names or default_names("y", self.y.shape[1])
        # an array has one unit: outputs of different ones are stored without
        common = {"units": self.output_units[0]} if len(set(self.output_units)) == 1 else {}
        arrays = {"y": (axes, self.y, common), "y_deviation": (axes, self.deviation, common)}
        return arrays, {"time": ("time", self.time, {"units": "s"}), "output": list(names)}, {}

    @property
    def deviation(self) -> FloatArray:
        """Standard deviation of the forecast error (steps, ny)."""
        return np.sqrt(np.maximum(np.einsum("tii->ti", self.covariance), 0.0))

    def interval(self, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Interval that holds an output with the probability `level`, innovations normal, (steps, ny) each."""
        reach = float(scipy.stats.norm.ppf(0.5 + 0.5 * confidence_level(level))) * self.deviation
        return self.y - reach, self.y + reach


def forecast(model: StateSpace | Estimate | Choice, data: IOData, steps: int, u: ArrayLike | None = None) -> Forecast:
    """Forecast the outputs of the `steps` samples that follow a record [BoxJenkins1976, ch. 5; Ljung1999, sec. 3.2].

    The error has three parts: the future innovations, the state at the end of the record as far as the record leaves it
    open (from its unknown initial state and its missing outputs), and of an estimate the covariance of its parameters,
    by the delta method.

    Args:
        model: The model with its innovation covariance, or an estimate of it.
        data: The past, all of which the forecast uses; it may end in missing outputs.
        steps: Number of samples, >= 1.
        u: Future inputs (steps, nu) in the coordinates of the record; None for a time series.

    Returns:
        The forecast, in the sequence of the data's channels.

    Raises:
        SysidError: Channels that do not fit the model, future inputs that are absent or of the wrong shape, a model
            without innovation covariance.
    """
    model = chosen_model(model)
    m = aligned(as_model(model), data)
    steps = whole_number("steps", steps, 1)
    if m.innovation_covariance is None:
        raise SysidError(
            "the model has no innovation covariance, which the uncertainty of a forecast needs; "
            "dataclasses.replace(model, innovation_covariance=...) adds one"
        )
    if m.nu and u is None:
        raise SysidError(f"future inputs u of shape ({steps}, {m.nu}) are needed: the model has {m.nu} input(s)")
    inputs = np.zeros((steps, 0)) if u is None else as_inputs(m, u)
    if len(inputs) != steps:
        raise SysidError(f"u: expected one row per step, shape ({steps}, {m.nu}), got {inputs.shape}")
    past, (input_level, level) = about_operating_point(model, replace(data, window=0))
    inputs = inputs - input_level
    covariance = _error_covariance(m, past, steps)
    if isinstance(model, Estimate) and np.isfinite(model.covariance).all():

        def forecast_outputs(theta: FloatArray) -> FloatArray:
            return _continued(aligned(model.realise(theta), past), past, inputs)

        moves = spread(forecast_outputs, model.parameters, model.covariance)
        covariance = covariance + np.einsum("kti,ktj->tij", moves, moves)
    return Forecast(
        time=data.start + data.dt * (len(data) + np.arange(steps, dtype=np.float64)),
        y=_continued(m, past, inputs) + level,
        covariance=covariance,
        output_names=data.output_names or (),
        output_units=data.output_units or (),
    )


def _continued(m: StateSpace, past: IOData, u: FloatArray) -> FloatArray:
    """Outputs expected after the record, from the state that follows its last sample (steps, ny)."""
    state = _state_after(m, past)
    return driven_output(m.A, m.B, m.C, m.D, u, state)


def _state_after(m: StateSpace, past: IOData) -> FloatArray:
    """Expected state one sample after the end of the record (n,)."""
    if past.complete or not (m.order and m.gain.any()):
        x0, observer = initial_state(m, past), m.A - m.gain @ m.C
        # without a gain the outputs, which may be missing, have no part in the state
        B, signals = predictor_inputs(m, m.gain, past.u, past.y)
        # a trajectory holds the states at its samples only: one more row leads to the state after the last
        return driven_states(observer, B, np.vstack((signals, np.zeros((1, B.shape[1])))), x0)[-1]
    no_input = np.zeros((1, past.nu))
    missing_output = np.full((1, past.ny), np.nan)
    extended = replace(past, u=np.vstack((past.u, no_input)), y=np.vstack((past.y, missing_output)))
    states, weights = kalman_filter(m, extended, np.zeros(m.order), free=True)
    x0 = fitted_state(m, extended, (states, weights))
    # the first column is the state from zero, the others those from unit initial states
    return states[-1] @ np.append(1.0, x0)


def _error_covariance(m: StateSpace, past: IOData, steps: int) -> FloatArray:
    """Covariance of the forecast error of the model itself (steps, ny, ny)."""
    R = np.asarray(m.innovation_covariance)
    P = _state_covariance(m, past, R)
    out, noise = np.empty((steps, m.ny, m.ny)), m.gain @ R @ m.gain.T
    for k in range(steps):
        out[k] = m.C @ P @ m.C.T + R
        P = m.A @ P @ m.A.T + noise
    return out


def _state_covariance(m: StateSpace, past: IOData, R: FloatArray) -> FloatArray:
    """Covariance of the state after the record (n, n): what its initial state and its missing outputs leave open."""
    return np.asarray(_covariance_from_initial_state(m, past, R) + _covariance_from_gaps(m, past, R))


def _covariance_from_initial_state(m: StateSpace, past: IOData, R: FloatArray) -> FloatArray:
    """Covariance of the last state from the fit of the initial state, (sum of free' R^-1 free)^-1 carried to the end.

    `free` is the response C (A - K C)^t to initial states, at the known outputs; R the covariance of the innovations.
    """
    if not m.order:
        return np.zeros((0, 0))
    observer = m.A - m.gain @ m.C
    free = free_response(observer, m.C, len(past))
    known_free = np.where(past.known[: len(free), :, None], free, 0.0)
    # a root of R^-1 by the pseudo-inverse: outputs without noise of their own leave R singular
    root = np.linalg.pinv(standard_directions(R))
    columns = np.einsum("ij,tjk->tik", root, known_free).reshape(-1, m.order)
    end = np.linalg.matrix_power(observer, len(past))
    return end @ np.linalg.pinv(columns.T @ columns, hermitian=True) @ end.T


def _covariance_from_gaps(m: StateSpace, past: IOData, R: FloatArray) -> FloatArray:
    """Covariance of the last state from missing outputs, by the Riccati recursion of the Kalman filter."""
    noise = m.gain @ R @ m.gain.T
    P = np.zeros((m.order, m.order))
    if past.complete or not noise.any():
        return P
    # up to the first missing output the state follows from the outputs
    first_gap = int(np.argmin(past.known.all(axis=1)))
    for mask in past.known[first_gap:]:
        C = m.C[mask]
        across = (m.A @ P @ m.C.T + m.gain @ R)[:, mask]
        S = C @ P @ C.T + R[np.ix_(mask, mask)]
        P = m.A @ P @ m.A.T + noise - across @ np.linalg.pinv(S, hermitian=True) @ across.T
    return P

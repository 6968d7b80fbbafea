"""Forecast of outputs beyond the end of a record, with its uncertainty."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.delta_method import spread, standard_directions
from sysid.models.estimate import Estimate
from sysid.models.predict import (
    Choice,
    about_operating_point,
    aligned,
    as_inputs,
    as_model,
    chosen_model,
    fitted_state,
    initial_state,
)
from sysid.models.recursion import free_response, kalman_filter, state_trajectory
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
        axes, names = ("time", "output"), self.output_names or default_names("y", self.y.shape[1])
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
    m, steps = aligned(as_model(model), data), whole_number("steps", steps, 1)
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
        moves = spread(
            lambda theta: _continued(aligned(model.realise(theta), past), past, inputs),
            model.parameters,
            model.covariance,
        )
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
    if past.complete or not (m.order and m.gain.any()):
        x0, observer = initial_state(m, past), m.A - m.gain @ m.C
        y = past.y if m.gain.any() else np.zeros_like(past.y)
        drive = past.u @ (m.B - m.gain @ m.D).T + y @ m.gain.T
        state = state_trajectory(observer, np.vstack((drive, np.zeros((1, m.order)))), x0)[-1]
    else:
        after = replace(
            past, u=np.vstack((past.u, np.zeros((1, past.nu)))), y=np.vstack((past.y, np.full((1, past.ny), np.nan)))
        )
        run = kalman_filter(m, after, np.zeros(m.order), free=True)
        state = run[0][-1] @ np.append(1.0, fitted_state(m, after, run))
    return state_trajectory(m.A, u @ m.B.T, state) @ m.C.T + u @ m.D.T


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
    observer, known, noise = m.A - m.gain @ m.C, past.known, m.gain @ R @ m.gain.T
    free = free_response(observer, m.C, len(past))
    root = np.linalg.pinv(standard_directions(R))
    columns = np.einsum("ij,tjk->tik", root, np.where(known[: len(free), :, None], free, 0.0)).reshape(-1, m.order)
    end = np.linalg.matrix_power(observer, len(past))
    P = end @ np.linalg.pinv(columns.T @ columns, hermitian=True) @ end.T if m.order else np.zeros((0, 0))
    gap = np.zeros_like(P)
    # up to the first missing output the state follows from the outputs
    for mask in known[int(np.argmin(known.all(axis=1))) :] if not past.complete and noise.any() else ():
        C = m.C[mask]
        across = (m.A @ gap @ m.C.T + m.gain @ R)[:, mask]
        S = C @ gap @ C.T + R[np.ix_(mask, mask)]
        gap = m.A @ gap @ m.A.T + noise - across @ np.linalg.pinv(S, hermitian=True) @ across.T
    return np.asarray(P + gap)

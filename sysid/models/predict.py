"""Simulation and prediction of a model on data, its residuals and its initial state."""

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.delta_method import standard_directions
from sysid.models.estimate import Estimate
from sysid.models.model_forms import AnyModel, as_model, chosen_model
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.recursion import (
    LARGEST,
    driven_output,
    driven_states,
    free_response,
    kalman_filter,
    output_deviations,
)
from sysid.models.state_space import StateSpace
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.channels import listed, matching_channels
from sysid.records.data import IOData, as_record
from sysid.records.errors import SysidError, SysidWarning


def simulate(
    model: AnyModel,
    u: ArrayLike | IOData,
    *,
    x0: ArrayLike | None = None,
    rng: np.random.Generator | None = None,
) -> FloatArray:
    """Output of x(t+1) = A x + B u + K e, y = C x + D u + e; without `rng` there is no noise, e = 0.

    Args:
        model: The model, or an estimate of it: a `StateSpace`, `Polynomials`, a `ContinuousModel`, or a system of
            python-control or SciPy. Continuous-time ones are sampled, exactly for a held input, at the interval of the
            record; with bare inputs they need one of their own.
        u: Inputs (N, nu), relative to the operating point of an estimate; 1-D for one input. Or a record, for the
            output in the coordinates of the record, as `predict` returns it.
        x0: State at the first sample (n,); zero by default, where `predict` and `compare` estimate it.
        rng: Generator of normal innovations e with the model's innovation covariance.

    Returns:
        Outputs (N, ny).

    Raises:
        SysidError: Inputs or initial state that do not fit the model; noise without an innovation covariance.
    """
    if isinstance(u, IOData):
        record, (_, level) = about_operating_point(model, u)
        return simulate(aligned(as_model(model, u), u), record.u, x0=x0, rng=rng) + level
    if isinstance(model, Polynomials):
        # the interval between samples has no part in their outputs
        model = innovations_form(model, 1.0)
    m = as_model(model)
    inputs, start = as_inputs(m, u), as_state(m, x0)
    if rng is None:
        return output(m, inputs, start)
    if not isinstance(rng, np.random.Generator):
        raise SysidError(f"rng: expected a numpy.random.Generator, got {type(rng).__name__}")
    if m.innovation_covariance is None:
        raise SysidError(
            "the model has no innovation covariance, which its noise needs; "
            "dataclasses.replace(model, innovation_covariance=...) adds one"
        )
    # a root of the covariance by eigenvectors: it may be singular
    e = rng.standard_normal((len(inputs), m.ny)) @ standard_directions(m.innovation_covariance).T
    B, D = np.hstack((m.B, m.gain)), np.hstack((m.D, np.eye(m.ny)))
    return driven_output(m.A, B, m.C, D, np.hstack((inputs, e)), start)


def output(model: StateSpace, u: FloatArray, x0: FloatArray) -> FloatArray:
    """Simulated output (N, ny) for checked inputs."""
    return driven_output(model.A, model.B, model.C, model.D, u, x0)


def as_inputs(model: StateSpace, u: ArrayLike) -> FloatArray:
    """Check inputs against the model and return them as (N, nu)."""
    out = real_array("u", u)
    if out.ndim == 1:
        out = out[:, None]
    if out.ndim != 2 or out.shape[1] != model.nu or not len(out):
        raise SysidError(f"u: expected shape (N, {model.nu}), time first, got {np.shape(u)}")
    return out


def as_state(model: StateSpace, x0: ArrayLike | None) -> FloatArray:
    """Check the initial state (n,); zero when None."""
    if x0 is None:
        return np.zeros(model.order)
    out = np.atleast_1d(real_array("x0", x0))
    if out.shape != (model.order,):
        raise SysidError(f"x0: expected one value per state, shape ({model.order},), got {out.shape}")
    return out


def predict(model: AnyModel, data: IOData, *, steps: int | None = 1, x0: ArrayLike | None = None) -> FloatArray:
    """Prediction of y(t) from outputs up to t - steps and inputs up to t [Ljung1999, sec. 3.2, 4.3].

    Channels of model and data are matched by name, those without names of their own by position.

    Missing outputs are predicted too, and later ones from the known outputs, by the Kalman filter. A record of the
    signals themselves, from which nothing was subtracted, is taken relative to the operating point of an estimate, and
    the prediction is in the coordinates of the record.

    Args:
        model: The model, in any form that `simulate` takes, or an estimate of it.
        data: Inputs and outputs.
        steps: Horizon in samples, >= 1; None simulates (an infinite horizon).
        x0: State at the first sample (n,). None fits it to the data by least squares: to the initialisation window if
            the record has one, else to the whole record.

    Returns:
        Predicted outputs (N, ny), in the sequence of the data. The first `steps` samples are simulated from the initial
        state.

    Raises:
        SysidError: Channels that do not fit the model in number, name or sampling interval, steps < 1.

    Warns:
        SysidWarning: The predictor A - K C is not stable, so that its errors grow.
    """
    m = aligned(as_model(model, data), data)
    record, (_, level) = about_operating_point(model, data)
    horizon = None if steps is None else whole_number("steps", steps, 1)
    return _predicted(m, record, horizon, x0) + level


def _predicted(m: StateSpace, data: IOData, steps: int | None, x0: ArrayLike | None) -> FloatArray:
    """Prediction from a record relative to the operating point, its channels in the sequence of the model's."""
    gain = np.zeros_like(m.gain) if steps is None else m.gain
    run = None
    if x0 is None and not data.complete and m.order and gain.any():
        # one run of the Kalman filter serves the initial state and the prediction
        run = kalman_filter(m, data, np.zeros(m.order), free=True)
        start = fitted_state(m, data, run)
    elif x0 is None:
        start = initial_state(m, data, gain)
    else:
        start = as_state(m, x0)
    if steps is None or not gain.any():
        return output(m, data.u, start)
    observer = m.A - m.gain @ m.C
    # poles on the unit circle, to rounding, let no error grow
    if m.order and np.abs(np.linalg.eigvals(observer)).max() > 1.0 + 1e-9:
        radius = float(np.abs(np.linalg.eigvals(observer)).max())
        warnings.warn(
            f"the predictor is unstable: A - K C has spectral radius {radius:.6g}; its predictions grow without bound",
            SysidWarning,
            stacklevel=3,
        )
    if data.complete:
        B, signals = predictor_inputs(m, m.gain, data.u, data.y)
        if steps == 1:
            D = np.hstack((m.D, np.zeros((m.ny, m.ny))))
            return driven_output(observer, B, m.C, D, signals, start)
        states = driven_states(observer, B, signals, start)
    elif run is not None:
        states = run[0][:, :, 0] + run[0][:, :, 1:] @ start
    else:
        states = kalman_filter(m, data, start)[0][:, :, 0]
    if steps == 1:
        return states @ m.C.T + data.u @ m.D.T
    horizon = min(int(steps), len(data))
    # from the states that know the outputs before them, the inputs alone lead on; the first samples are simulated
    ahead = states[: len(data) - horizon + 1]
    for k in range(horizon - 1):
        ahead = ahead @ m.A.T + data.u[k : k + len(ahead)] @ m.B.T
    out = output(m, data.u, start)
    out[horizon - 1 :] = ahead @ m.C.T + data.u[horizon - 1 :] @ m.D.T
    return out


def predictor_inputs(model: StateSpace, K: FloatArray, u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Input matrix (n, nu + ny) and signals [u, y] of the predictor with gain K; without y where K is zero."""
    if not K.any():
        return model.B, u
    return np.hstack((model.B - K @ model.D, K)), np.hstack((u, y))


def initial_state(model: StateSpace, data: IOData, gain: FloatArray | None = None) -> FloatArray:
    """State at the first sample that makes the (predicted) output fit best, by weighted least squares.

    The weight of an output is the inverse variance of its innovations; where the model has none, or its simulated
    output is fitted although it has a gain K, the inverse variance of the output itself.
    """
    model = aligned(model, data)
    if model.order == 0:
        return np.zeros(0)
    K = model.gain if gain is None else gain
    samples = data.window or len(data)
    u, y = data.u[:samples], data.y[:samples]
    deviations = output_deviations(y)
    if model.innovation_covariance is not None and np.array_equal(K, model.gain):
        # an output that the model explains to rounding must not hide the others
        innovations = np.sqrt(np.diag(model.innovation_covariance))
        deviations = np.maximum(innovations, 1e-8 * deviations)
    elif not data.complete:
        model = replace(model, innovation_covariance=np.diag(deviations**2))
    if not data.complete:
        run = kalman_filter(replace(model, K=K), data, np.zeros(model.order), free=True)
        return fitted_state(model, data, run)
    observer = model.A - K @ model.C
    free = free_response(observer, model.C, samples)
    # samples after the free response has died out carry no information on the initial state
    u, y = u[: len(free)], y[: len(free)]
    B, signals = predictor_inputs(model, K, u, y)
    D = np.hstack((model.D, np.zeros((model.ny, B.shape[1] - model.nu))))
    error = y - driven_output(observer, B, model.C, D, signals, np.zeros(model.order))
    # an unstable model: only the samples before its response grows too large to compute with
    usable = (np.abs(error) < LARGEST).all(axis=1)
    rows = len(free) if usable.all() else int(np.argmin(usable))
    # only ratios of weights matter, and these keep the numbers of a single output as they are
    ratios = deviations / deviations[0]
    phi, target = (free / ratios[:, None])[:rows], (error / ratios)[:rows]
    solution, *_ = np.linalg.lstsq(phi.reshape(-1, model.order), target.ravel(), rcond=None)
    return np.asarray(solution, dtype=np.float64)


def fitted_state(model: StateSpace, data: IOData, run: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Initial state (n,) from the known outputs of a record with gaps, each weighted by its prediction variance.

    `run` is that of `kalman_filter` from the state zero, with the free responses.
    """
    states, weights = run
    outputs = np.einsum("ij,tjk->tik", model.C, states)
    error = np.where(data.known, data.y, 0.0) - outputs[:, :, 0] - data.u @ model.D.T
    usable = (np.abs(outputs) < LARGEST).all(axis=(1, 2))
    usable_rows = len(usable) if usable.all() else int(np.argmin(usable))
    rows = min(data.window or len(data), usable_rows)
    phi = (weights[:, :, None] * outputs[:, :, 1:])[:rows].reshape(-1, model.order)
    solution, *_ = np.linalg.lstsq(phi, (weights * error)[:rows].ravel(), rcond=None)
    return np.asarray(solution, dtype=np.float64)


def channels_in(model: StateSpace, data: IOData) -> tuple[list[int], list[int]]:
    """Index in the model of every input and every output of a record, matched by name.

    Raises:
        SysidError: Other channels or another sampling interval than the model's.
    """
    as_record(data)
    if (data.nu, data.ny) != (model.nu, model.ny):
        raise SysidError(
            f"the data have {data.nu} input(s) ({listed(data.input_names)}) and {data.ny} output(s) "
            f"({listed(data.output_names)}), the model {model.nu} ({listed(model.input_names)}) and {model.ny} "
            f"({listed(model.output_names)}); data.select(inputs=..., outputs=...) picks channels"
        )
    if not np.isclose(data.dt, model.dt, rtol=1e-6, atol=0.0):
        raise SysidError(f"the data are sampled every {data.dt} s, the model every {model.dt} s")
    sides = {"owner": "the data", "other": "the model"}
    return (
        matching_channels("input", data.input_names, model.input_names, **sides),
        matching_channels("output", data.output_names, model.output_names, **sides),
    )


def aligned(model: StateSpace, data: IOData) -> StateSpace:
    """The model with its channels in the sequence of a record's, matched by name.

    Raises:
        SysidError: Other channels or another sampling interval than the model's.
    """
    inputs, outputs = channels_in(model, data)
    if inputs == sorted(inputs) and outputs == sorted(outputs):
        return model
    covariance = model.innovation_covariance
    if covariance is not None:
        covariance = covariance[np.ix_(outputs, outputs)]

    def picked(labels: tuple[str, ...] | None, channels: list[int]) -> tuple[str, ...]:
        return tuple((labels or ())[k] for k in channels)

    reordered = replace(
        model,
        B=model.B[:, inputs],
        C=model.C[outputs],
        D=model.D[np.ix_(outputs, inputs)],
        K=model.gain[:, outputs],
        innovation_covariance=covariance,
    )
    return replace(
        reordered,
        input_names=picked(model.input_names, inputs),
        output_names=picked(model.output_names, outputs),
        input_units=picked(model.input_units, inputs),
        output_units=picked(model.output_units, outputs),
    )


def about_operating_point(model: AnyModel, data: IOData) -> tuple[IOData, tuple[FloatArray, FloatArray]]:
    """The record relative to the operating point of an estimate, and what was subtracted (nu,) and (ny,).

    That is nothing where the record is relative to a point of its own, or the model has none.
    """
    model = chosen_model(model)
    point = model.operating_point if isinstance(model, Estimate) else None
    if point is None or data.input_offset is not None:
        return data, (np.zeros(data.nu), np.zeros(data.ny))
    inputs, outputs = channels_in(as_model(model), data)
    u_level, y_level = point[0][inputs], point[1][outputs]
    return data.subtract(u=u_level, y=y_level), (u_level, y_level)


def residuals(model: AnyModel, data: IOData, *, x0: ArrayLike | None = None) -> FloatArray:
    """y(t) minus its one-step prediction [Ljung1999, sec. 3.2].

    Args:
        model: The model, in any form that `simulate` takes, or an estimate of it.
        data: Inputs and outputs.
        x0: State at the first sample (n,); None fits it (see `predict`).

    Returns:
        Prediction errors (N, ny), in the sequence of the data.

    Raises:
        SysidError: Channels that do not fit the model.
    """
    return as_record(data).y - predict(model, data, x0=x0)


def findstates(model: AnyModel, data: IOData, *, simulation: bool = False) -> FloatArray:
    """State at the first sample for which the model explains the data best, by least squares [Ljung1999, sec. 10.5].

    Use it as `x0` of `simulate`, `predict` and `residuals`.

    Args:
        model: The model, in any form that `simulate` takes, or an estimate of it.
        data: Inputs and outputs; of a record with an initialisation window, only the window is used.
        simulation: Whether to fit the simulated output; otherwise the one-step prediction.

    Returns:
        State (n,), of least norm if the data do not determine it.

    Raises:
        SysidError: Channels that do not fit the model.
    """
    simulation = truth_value("simulation", simulation)
    m = aligned(as_model(model, data), data)
    data, _ = about_operating_point(model, data)
    gain = np.zeros_like(m.gain) if simulation else None
    return initial_state(m, data, gain)

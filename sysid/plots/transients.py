"""Responses over time to a pulse and to a step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from sysid.frequency.cra import ImpulseResponse
from sysid.models.confidence_bands import band
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import NORMAL_95
from sysid.models.state_space import StateSpace
from sysid.plots.palette import INK, Style
from sysid.plots.panels import (
    channel_indices,
    channel_names,
    check_same_channels,
    finish,
    label,
    line,
    panels,
    shade,
    size_of,
)
from sysid.plots.traces import StyleChooser, named_items
from sysid.records.arguments import real_number
from sysid.records.arrays import FloatArray
from sysid.records.printing import AT_ZERO

Responding = Estimate | StateSpace | ImpulseResponse
"""Anything with a response over time."""

SETTLED = 5e-3  # remainder of the slowest mode at the end of the axis
SHORTEST, LONGEST, ENDLESS = 20, 3000, 100
"""Bounds on the number of samples, and the number for models that do not decay."""


@dataclass(frozen=True, eq=False)
class _Response:
    label: str
    style: Style
    time: FloatArray
    values: FloatArray
    deviation: FloatArray | None
    names: tuple[tuple[str, ...], tuple[str, ...]]
    units: tuple[tuple[str, ...], tuple[str, ...]]


def impulse(
    models: Responding | Sequence[Responding] | Mapping[str, Responding],
    *,
    length: float | None = None,
    output: int | str | None = None,
    input: int | str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Response to a pulse of one sample and height one, with 95 % bands where the uncertainty is known.

    With several channels a row per output and a column per input. A time series responds to its innovation.

    Args:
        models: Models, estimates, or the result of `cra`: one, several, or several by name.
        length: Length of the axis, s; by default until the slowest mode has died out.
        output: Output by index or name; all when None.
        input: Input by index or name; all when None.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, something without a response, a length that is not positive, models with
            different channels.
    """
    return _draw(_responses(models, length, step=False), "pulse response", output, input, size)


def step(
    models: Responding | Sequence[Responding] | Mapping[str, Responding],
    *,
    length: float | None = None,
    output: int | str | None = None,
    input: int | str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Response to a unit step, with 95 % bands of estimates.

    With several channels a row per output and a column per input. The result of `cra` is summed up, without a band.

    Args:
        models: Models, estimates, or the result of `cra`: one, several, or several by name.
        length: Length of the axis, s; by default until the slowest mode has died out.
        output: Output by index or name; all when None.
        input: Input by index or name; all when None.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, something without a response, a length that is not positive, models with
            different channels.
    """
    return _draw(_responses(models, length, step=True), "step response", output, input, size)


def _responses(
    models: Responding | Sequence[Responding] | Mapping[str, Responding], length: float | None, *, step: bool
) -> list[_Response]:
    if length is not None:
        length = real_number("length", length, "be above 0 s", lambda time: 0.0 < time < np.inf)
    styles = StyleChooser()
    pairs = list(named_items(models, (Estimate, StateSpace, ImpulseResponse)))
    reach = length if length is not None else max(_settling(item) for _, item in pairs)
    out = []
    for name, item in pairs:
        model = item.model if isinstance(item, Estimate) else item
        if isinstance(item, ImpulseResponse):
            method, shown = "cra", name or "correlation analysis"
        else:
            method, shown = getattr(item, "method", ""), name or styles.label(item)
        # Rounding in the division must not lose the last sample.
        samples = max(int(np.floor(reach / model.dt + 1e-9)) + 1, 2)
        # A finite impulse response is zero from there on.
        if isinstance(model, StateSpace) and (memory := _memory(model)):
            samples = min(samples, memory)
        deviation: FloatArray | None = None
        if isinstance(item, ImpulseResponse):
            lags = item.step_response if step else item.response
            values = lags[:samples]
            # the deviation of a running sum needs the correlation of the lags, which is unknown
            deviation = None if step else item.deviation[:samples]
        else:
            quantity = partial(_transient, samples=samples, step=step)
            values = quantity(model)
            if isinstance(item, Estimate) and np.isfinite(item.covariance).all():
                deviation = band(item, quantity).deviation
        _, ny, nu = values.shape
        model = model if not isinstance(model, StateSpace) or model.nu else model.input_path()
        names = (channel_names(model.output_names or (), ny, "y"), channel_names(model.input_names or (), nu, "u"))
        units = (getattr(model, "output_units", None) or ("",) * ny, getattr(model, "input_units", None) or ("",) * nu)
        time = np.arange(len(values)) * model.dt
        out.append(_Response(shown, styles.next(method), time, values, deviation, names, units))
    check_same_channels([(response.label, response.values.shape[1:]) for response in out])
    return out


def _transient(model: StateSpace, samples: int, step: bool) -> FloatArray:
    model = model if model.nu else model.input_path()
    return model.step_response(samples) if step else model.impulse_response(samples)


def _memory(model: StateSpace) -> int:
    """Number of samples of a finite impulse response; 0 of one without end."""
    path = model.input_path()
    return 0 if (np.abs(path.poles()) > AT_ZERO).any() else path.order + 1


def _settling(item: Responding) -> float:
    """Time until the slowest mode has died out, s."""
    if isinstance(item, ImpulseResponse):
        return float(item.time[-1])
    model = item.model if isinstance(item, Estimate) else item
    model = model.input_path()
    if memory := _memory(model):
        return (memory - 1) * model.dt
    slowest = float(np.abs(model.poles()).max(initial=0.0))
    # The pole of an integrator is one but for rounding; it never decays.
    samples = ENDLESS if slowest >= 1.0 - 1e-9 else np.log(SETTLED) / np.log(max(slowest, 1e-9))
    return float(np.clip(np.ceil(samples), SHORTEST, LONGEST)) * model.dt


def _draw(
    responses: Sequence[_Response],
    quantity: str,
    output: int | str | None,
    input: int | str | None,
    size: tuple[float, float] | None,
) -> Figure:
    outputs, inputs = responses[0].names
    rows, columns = channel_indices("output", output, outputs), channel_indices("input", input, inputs)
    figure, grid = panels(
        len(rows), len(columns), size_of(size, len(rows), len(columns), (7.0, 3.8), (3.0, 2.2)), sharex=True
    )
    for a, i in enumerate(rows):
        for b, j in enumerate(columns):
            axes = grid[a, b]
            axes.axhline(0.0, color=INK, lw=0.8)
            for response in responses:
                values = response.values[:, i, j]
                line(axes, response.time, values, response.style, response.label)
                if response.deviation is not None:
                    reach = NORMAL_95 * response.deviation[:, i, j]
                    shade(axes, response.time, values - reach, values + reach, response.style)
            if len(rows) * len(columns) > 1:
                axes.set_title(f"{inputs[j]} → {outputs[i]}", loc="left", fontsize=9)
            if b == 0:
                output_units, input_units = responses[0].units
                above, below = output_units[i], {input_units[k] for k in columns}
                # no common unit for inputs in different units
                has_unit = above and len(below) == 1 and all(below)
                unit = f"({above}/{below.pop()})" if has_unit else ""
                axes.set_ylabel(label(quantity, unit))
    return finish(figure, grid, "time / s")

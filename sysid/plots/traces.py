"""What a figure draws, and how records become that: names and looks where none are given."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid.frequency.bla import BestLinearApproximation
from sysid.models.bands import poles_band, zeros_band
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.state_space import StateSpace
from sysid.plots.palette import DISTORTION, NOISE, PALETTE, Style
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError
from sysid.validation.compare import ModelFit


@dataclass(frozen=True, eq=False)
class Level:
    """A magnitude to draw beside a response.

    Attributes:
        label: Text of the legend.
        values: Magnitudes (nf, ny, nu).
        style: How it looks.
    """

    label: str
    values: FloatArray
    style: Style


@dataclass(frozen=True, eq=False)
class Curve:
    """A frequency response to draw; with a covariance it gets a 95 % band.

    Attributes:
        label: Text of the legend.
        response: The response.
        style: How it looks; by default as its method does everywhere.
        levels: Magnitudes that belong to it.
    """

    label: str
    response: FrequencyResponse
    style: Style | None = None
    levels: tuple[Level, ...] = ()


@dataclass(frozen=True, eq=False)
class Roots:
    """Poles and zeros to draw.

    Attributes:
        label: Text of the legend.
        model: The model.
        style: How it looks.
        regions: Outlines of 95 % regions, one of (points,) for each root that has one.
    """

    label: str
    model: StateSpace
    style: Style
    regions: tuple[ComplexArray, ...] = ()


@dataclass(frozen=True, eq=False)
class Trace:
    """Something over time or lag or frequency.

    Attributes:
        label: Text of the legend.
        values: Values (N,), or of several outputs (N, ny).
        style: How it looks.
    """

    label: str
    values: FloatArray
    style: Style


def curves_of(
    given: "Drawable | Sequence[Drawable] | Mapping[str, Drawable]", frequencies: FloatArray | None
) -> list[Curve]:
    """Curves of responses, models and estimates; a `Curve` passes as it is."""
    looks = Looks()
    curves = []
    for name, item in named_items(given, (Curve, FrequencyResponse, Estimate, StateSpace, BestLinearApproximation)):
        if isinstance(item, Curve):
            curves.append(item if name is None else replace(item, label=name))
            if item.style is not None:
                looks.taken.append(item.style)
            continue
        levels: tuple[Level, ...] = ()
        if isinstance(item, BestLinearApproximation):
            response, levels = item.response, _levels(item)
        else:
            response = item if isinstance(item, FrequencyResponse) else _response(item, frequencies)
        shown = name or looks.label(response if levels else item)
        curves.append(Curve(shown, response, looks.next(response.method), levels))
    return curves


def roots_of(given: "Rooted | Sequence[Rooted] | Mapping[str, Rooted]", *, regions: bool = True) -> list[Roots]:
    """Poles and zeros of models and estimates; a `Roots` passes as it is."""
    looks = Looks()
    roots = []
    for name, item in named_items(given, (Roots, Estimate, StateSpace)):
        if isinstance(item, Roots):
            roots.append(item if name is None else replace(item, label=name))
            looks.taken.append(item.style)
            continue
        model = item.model.input_path() if isinstance(item, Estimate) else item
        method = item.method if isinstance(item, Estimate) else ""
        outlines = _regions(item) if regions and isinstance(item, Estimate) else ()
        roots.append(Roots(name or looks.label(item), model, looks.next(method), outlines))
    return roots


def traces_of(
    given: "Trace | ModelFit | Sequence[Trace | ModelFit]", outputs: Sequence[int], *, ahead: bool = False
) -> list[Trace]:
    """Outputs of fits, with their percentages; a `Trace` passes as it is."""
    looks = Looks()
    traces = []
    for _, item in named_items(given, (Trace, ModelFit)):
        if isinstance(item, Trace):
            traces.append(item)
            looks.taken.append(item.style)
            continue
        fits = item.ahead if ahead else item.simulation
        label = f"{item.name}: {', '.join(f'{fits[i]:.1f}' for i in outputs)} %"
        label += f", {item.steps} ahead" if ahead else ""
        style = looks.next(item.name.lower().rpartition(" ")[2])
        traces.append(Trace(label, item.predicted_ahead if ahead else item.simulated, style))
    return traces


class Looks:
    """Names and styles for what brings none, each once."""

    def __init__(self) -> None:
        self.taken: list[Style] = []
        self.labels: list[str] = []

    def label(self, item: object) -> str:
        """Name of a record, from its method and orders."""
        method = getattr(item, "method", "")
        base = method.upper() if method else "model"
        orders = getattr(item, "orders", None)
        if orders:
            base += " " + " ".join(f"{value}" for value in orders.values() if isinstance(value, int | np.integer))
        self.labels.append(base)
        count = self.labels.count(base)
        return base.strip() if count == 1 else f"{base.strip()} ({count})"

    def next(self, method: str) -> Style:
        """The style of a method, or another where that is taken."""
        preferred = PALETTE.get(method)
        # The greys and pinks of measured data say "data", so no model is given them.
        free = [
            style for name, style in PALETTE.items() if style not in self.taken and name not in ("measured", "etfe")
        ]
        style = preferred if preferred is not None and preferred not in self.taken else (free or [PALETTE["truth"]])[0]
        self.taken.append(style)
        return style


def named_items(given: object, kinds: tuple[type, ...]) -> Iterator[tuple[str | None, Any]]:
    """Pairs of a name, None where there is none, and a thing to draw."""
    pairs: list[tuple[str | None, Any]]
    if isinstance(given, Mapping):
        pairs = [(str(name), item) for name, item in given.items()]
    elif isinstance(given, kinds):
        pairs = [(None, given)]
    elif isinstance(given, Sequence) and not isinstance(given, str):
        pairs = [(None, item) for item in given]
    else:
        pairs = [(None, given)]
    if not pairs:
        raise SysidError(f"nothing to draw; expected one or more of {_names(kinds)}")
    for _, item in pairs:
        if not isinstance(item, kinds):
            raise SysidError(f"cannot draw a {type(item).__name__}; expected {_names(kinds)}")
    return iter(pairs)


def _names(kinds: tuple[type, ...]) -> str:
    return ", ".join(kind.__name__ for kind in kinds)


def _response(item: Estimate | StateSpace, frequencies: FloatArray | None) -> FrequencyResponse:
    model = item.model if isinstance(item, Estimate) else item
    nyquist = 0.5 / model.dt
    f = np.geomspace(1e-3 * nyquist, nyquist, 300) if frequencies is None else np.asarray(frequencies, dtype=float)
    if isinstance(item, Estimate):
        return item.frequency_response(f)
    return FrequencyResponse(
        f,
        model.frequency_response(f),
        model.dt,
        "model",
        input_names=model.input_names or (),
        output_names=model.output_names or (),
    )


def _levels(found: BestLinearApproximation) -> tuple[Level, ...]:
    """Standard deviations of a single realisation's response."""
    return (
        Level("noise, one realisation", np.sqrt(found.realisations * found.noise_variance), NOISE),
        Level("distortion, one realisation", np.sqrt(found.distortion_variance), DISTORTION),
    )


def _regions(found: Estimate) -> tuple[ComplexArray, ...]:
    """Outlines of the roots that are known well enough to have one."""
    return tuple(
        outline
        for roots in (poles_band(found), zeros_band(found))
        for root, outline in zip(roots.roots, roots.ellipses(), strict=True)
        if np.isfinite(outline).all() and np.abs(root) <= REACH
    )


REACH = 1.6
"""Roots beyond this modulus are left out of a map and counted."""

Drawable = Curve | FrequencyResponse | Estimate | StateSpace | BestLinearApproximation
"""What has a frequency response."""

Rooted = Roots | Estimate | StateSpace
"""What has poles and zeros."""

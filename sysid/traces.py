"""What a figure draws, and how records become that: names and looks where none are given."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid.arrays import FloatArray
from sysid.compare import ModelFit
from sysid.errors import SysidError
from sysid.estimate import Estimate
from sysid.frequency import FrequencyResponse
from sysid.palette import PALETTE, Style
from sysid.state_space import StateSpace


@dataclass(frozen=True, eq=False)
class Curve:
    """A frequency response to draw; with a covariance it gets a 95 % band.

    Attributes:
        label: Text of the legend.
        response: The response.
        style: How it looks; by default as its method does everywhere.
    """

    label: str
    response: FrequencyResponse
    style: Style | None = None


@dataclass(frozen=True, eq=False)
class Roots:
    """Poles and zeros to draw.

    Attributes:
        label: Text of the legend.
        model: The model.
        style: How it looks.
    """

    label: str
    model: StateSpace
    style: Style


@dataclass(frozen=True, eq=False)
class Trace:
    """Something over time or lag or frequency.

    Attributes:
        label: Text of the legend.
        values: Values (N,).
        style: How it looks.
    """

    label: str
    values: FloatArray
    style: Style


def curves_of(
    given: "Drawable | Sequence[Drawable] | Mapping[str, Drawable]", frequencies: FloatArray | None
) -> list[Curve]:
    """Curves of responses, models and estimates; a `Curve` passes as it is.

    Args:
        given: One, several, or several by name.
        frequencies: Where models and estimates are evaluated, Hz; up to their Nyquist frequency when not given.

    Raises:
        SysidError: Nothing, or something that has no frequency response.
    """
    looks = _Looks()
    curves = []
    for name, item in _named(given, (Curve, FrequencyResponse, Estimate, StateSpace)):
        if isinstance(item, Curve):
            curves.append(item if name is None else replace(item, label=name))
            if item.style is not None:
                looks.taken.append(item.style)
            continue
        response = item if isinstance(item, FrequencyResponse) else _response(item, frequencies)
        curves.append(Curve(name or looks.label(item), response, looks.next(response.method)))
    return curves


def roots_of(given: "Rooted | Sequence[Rooted] | Mapping[str, Rooted]") -> list[Roots]:
    """Poles and zeros of models and estimates; a `Roots` passes as it is.

    Raises:
        SysidError: Nothing, or something that has no poles.
    """
    looks = _Looks()
    roots = []
    for name, item in _named(given, (Roots, Estimate, StateSpace)):
        if isinstance(item, Roots):
            roots.append(item if name is None else replace(item, label=name))
            looks.taken.append(item.style)
            continue
        model = item.model if isinstance(item, Estimate) else item
        method = item.method if isinstance(item, Estimate) else ""
        roots.append(Roots(name or looks.label(item), model, looks.next(method)))
    return roots


def traces_of(given: "Trace | ModelFit | Sequence[Trace | ModelFit]", output: int) -> list[Trace]:
    """Simulated outputs of fits, with their percentages; a `Trace` passes as it is.

    Raises:
        SysidError: Nothing, or something that is neither.
    """
    looks = _Looks()
    traces = []
    for _, item in _named(given, (Trace, ModelFit)):
        if isinstance(item, Trace):
            traces.append(item)
            looks.taken.append(item.style)
            continue
        label = f"{item.name}: {item.simulation[output]:.1f} %"
        traces.append(Trace(label, item.simulated[:, output], looks.next(item.name.lower())))
    return traces


class _Looks:
    """Names and styles for what brings none, each once."""

    def __init__(self) -> None:
        self.taken: list[Style] = []
        self.labels: list[str] = []

    def label(self, item: object) -> str:
        method = getattr(item, "method", "")
        base = method.upper() if method else "model"
        orders = getattr(item, "orders", None)
        if orders:
            base += " " + " ".join(f"{value}" for value in orders.values() if isinstance(value, int | np.integer))
        self.labels.append(base)
        count = self.labels.count(base)
        return base.strip() if count == 1 else f"{base.strip()} ({count})"

    def next(self, method: str) -> Style:
        preferred = PALETTE.get(method)
        # The greys and pinks of measured data say "data", so no model is given them.
        free = [
            style for name, style in PALETTE.items() if style not in self.taken and name not in ("measured", "etfe")
        ]
        style = preferred if preferred is not None and preferred not in self.taken else (free or [PALETTE["truth"]])[0]
        self.taken.append(style)
        return style


def _named(given: object, kinds: tuple[type, ...]) -> Iterator[tuple[str | None, Any]]:
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
    return FrequencyResponse(f, model.frequency_response(f), model.dt, "model")


Drawable = Curve | FrequencyResponse | Estimate | StateSpace
"""What has a frequency response."""

Rooted = Roots | Estimate | StateSpace
"""What has poles and zeros."""

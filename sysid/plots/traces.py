"""Drawable items of figures, made from records with default names and styles."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid.frequency.bla import BestLinearApproximation
from sysid.models.confidence_bands import poles_band, zeros_band
from sysid.models.continuous_model import ContinuousModel
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.model_forms import AnyModel, as_model, chosen_model, is_foreign
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace
from sysid.plots.palette import DISTORTION, NOISE, PALETTE, Style
from sysid.plots.panels import grid_of_frequencies
from sysid.records.arguments import truth_value
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.channels import matching_channels
from sysid.records.errors import SysidError
from sysid.validation.compare import ModelFit


@dataclass(frozen=True, eq=False)
class Level:
    """A magnitude to draw beside a response.

    Attributes:
        label: Text of the legend.
        values: Magnitudes (nf, ny, nu).
        style: Style.
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
        style: Style; by default that of its method.
        levels: Magnitudes drawn with it.
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
        style: Style.
        regions: Outlines of 95 % regions, one of (points,) for each root that has one.
    """

    label: str
    model: StateSpace
    style: Style
    regions: tuple[ComplexArray, ...] = ()


@dataclass(frozen=True, eq=False)
class Trace:
    """Values over time, lag or frequency.

    Attributes:
        label: Text of the legend.
        values: Values (N,), or of several outputs (N, ny).
        style: Style.
    """

    label: str
    values: FloatArray
    style: Style


WITH_RESPONSE = (Curve, FrequencyResponse, Estimate, StateSpace, ContinuousModel, BestLinearApproximation)
"""Kinds of items that `curves_of` takes."""


def curves_of(
    items: "Drawable | Sequence[Drawable] | Mapping[str, Drawable]", frequencies: FloatArray | None
) -> list[Curve]:
    """Curves of responses, models and estimates; a `Curve` is unchanged."""
    styles = StyleChooser()
    curves = []
    for name, item in named_items(items, WITH_RESPONSE):
        if isinstance(item, Curve):
            curve = item if name is None else replace(item, label=name)
            curves.append(curve)
            if item.style is not None:
                styles.used.append(item.style)
            continue
        levels: tuple[Level, ...] = ()
        if isinstance(item, BestLinearApproximation):
            response, levels = item.response, _levels(item)
        else:
            response = item if isinstance(item, FrequencyResponse) else _response(item, frequencies)
        if not response.response.shape[2]:
            raise SysidError(f"{response.method}: a time series has no input; plots.spectra draws its spectrum")
        # The label of a best linear approximation is that of its response, which has a method.
        labelled = response if levels else item
        shown = name or styles.label(labelled)
        curves.append(Curve(shown, response, styles.next(response.method), levels))
    return curves


def roots_of(items: "Rooted | Sequence[Rooted] | Mapping[str, Rooted]", *, regions: bool = True) -> list[Roots]:
    """Poles and zeros of models and estimates; a `Roots` is unchanged."""
    regions = truth_value("regions", regions)
    styles = StyleChooser()
    roots = []
    for name, item in named_items(items, (Roots, Estimate, StateSpace)):
        if isinstance(item, Roots):
            named = item if name is None else replace(item, label=name)
            roots.append(named)
            styles.used.append(item.style)
            continue
        model = item.model.input_path() if isinstance(item, Estimate) else item
        method = item.method if isinstance(item, Estimate) else ""
        outlines = _regions(item) if regions and isinstance(item, Estimate) else ()
        roots.append(Roots(name or styles.label(item), model, styles.next(method), outlines))
    return roots


def traces_of(
    items: "Trace | ModelFit | Sequence[Trace | ModelFit]",
    outputs: Sequence[int],
    names: Sequence[str],
    *,
    ahead: bool = False,
) -> list[Trace]:
    """Outputs of fits, in the sequence of `names`, with the percentages of some; a `Trace` is unchanged."""
    styles = StyleChooser()
    traces = []
    for _, item in named_items(items, (Trace, ModelFit)):
        if isinstance(item, Trace):
            traces.append(item)
            styles.used.append(item.style)
            continue
        order = list(range(len(item.simulation)))
        if len(item.output_names) == len(names):
            order = matching_channels("output", names, item.output_names, owner="the record", other=item.name)
        fits = item.ahead if ahead else item.simulation
        values = item.predicted_ahead if ahead else item.simulated
        percentages = ", ".join(f"{fit:.1f}" for fit in fits[order][list(outputs)])
        label = f"{item.name}: {percentages} %"
        if ahead:
            label += f", {item.steps} ahead"
        style = styles.next(item.name.lower().rpartition(" ")[2])
        traces.append(Trace(label, values[:, order], style))
    return traces


class StyleChooser:
    """Default names and styles, each used once."""

    def __init__(self) -> None:
        self.used: list[Style] = []
        self.labels: list[str] = []

    def label(self, item: object) -> str:
        """Default name of a record, from its method and orders."""
        method = getattr(item, "method", "")
        base = method.upper() if method else "model"
        orders = getattr(item, "orders", None)
        if orders:
            whole = {name: value for name, value in orders.items() if isinstance(value, int | np.integer)}
            base += " " + ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in whole.items())
        self.labels.append(base)
        count = self.labels.count(base)
        return base.strip() if count == 1 else f"{base.strip()} ({count})"

    def next(self, method: str) -> Style:
        """The style of a method, or another one if that is in use."""
        preferred = PALETTE.get(method)
        # The greys and pinks of measured data are reserved for data.
        others = [style for name, style in PALETTE.items() if name not in ("measured", "etfe")]
        free = [style for style in others if style not in self.used]
        if preferred is not None and preferred not in self.used:
            style = preferred
        else:
            style = free[0] if free else PALETTE["truth"]
        self.used.append(style)
        return style


def named_items(items: object, kinds: tuple[type, ...]) -> Iterator[tuple[str | None, Any]]:
    """Pairs of name (or None) and item of one record, several, or several by name; refuse other kinds."""
    pairs: list[tuple[str | None, Any]]
    available = ", ".join(kind.__name__ for kind in kinds)
    if isinstance(items, Mapping):
        pairs = [(str(name), _drawable(item)) for name, item in items.items()]
    else:
        are_several = isinstance(items, Sequence) and not isinstance(items, (str, *kinds))
        several: Any = items if are_several else [items]
        pairs = [(None, _drawable(item)) for item in several]
    if not pairs:
        raise SysidError(f"nothing to draw; expected one or more of {available}")
    for _, item in pairs:
        if not isinstance(item, kinds):
            raise SysidError(f"cannot draw a {type(item).__name__}; expected {available}")
    return iter(pairs)


def _drawable(item: Any) -> Any:
    """The estimate of a choice, the model of a system of another package; other items unchanged."""
    item = chosen_model(item)
    return as_model(item) if is_foreign(item) or isinstance(item, Polynomials) else item


def _response(item: Estimate | StateSpace | ContinuousModel, frequencies: FloatArray | None) -> FrequencyResponse:
    model = item.model if isinstance(item, Estimate) else item
    states = model.states if isinstance(model, ContinuousModel) else model
    f = grid_of_frequencies(frequencies, states.dt)
    if isinstance(item, Estimate):
        return item.frequency_response(f)
    return FrequencyResponse(
        f,
        model.frequency_response(f),
        states.dt,
        "model",
        input_names=states.input_names or (),
        output_names=states.output_names or (),
    )


def _levels(bla: BestLinearApproximation) -> tuple[Level, ...]:
    """Standard deviations of the response in a single realisation."""
    return (
        # The variance of noise is that of the mean over realisations, the variance of distortion that of one already.
        Level("noise, one realisation", np.sqrt(bla.realisations * bla.noise_variance), NOISE),
        Level("distortion, one realisation", np.sqrt(bla.distortion_variance), DISTORTION),
    )


def _regions(estimate: Estimate) -> tuple[ComplexArray, ...]:
    """Outlines of the roots with a finite region within the map."""
    outlines = []
    for roots in (poles_band(estimate), zeros_band(estimate)):
        for root, outline in zip(roots.roots, roots.ellipses(), strict=True):
            if np.isfinite(outline).all() and np.abs(root) <= REACH:
                outlines.append(outline)
    return tuple(outlines)


REACH = 1.6  # modulus beyond which roots are not drawn in a map, but counted

Drawable = Curve | FrequencyResponse | BestLinearApproximation | AnyModel
"""Anything with a frequency response."""

Rooted = Roots | Estimate | StateSpace
"""Anything with poles and zeros."""

"""Charts of many models: every data set, orders, disturbed records."""

from collections.abc import Iterator

import numpy as np

from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.chart import Panel, Series
from scenarios.report.figure_style import points, short
from scenarios.thesis.chart import chart_of, joints
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES
from scenarios.thesis.order_search import Iteration, Search
from scenarios.thesis.robustness import Robustness, sysid_method
from sysid.plots import PALETTE, Style
from sysid.validation import StructureTable

METHODS = ("arx", "iv4", "armax", "oe", "okid")

HERTZ = (0.3, 4.0)
"""Bandwidths that are shown, Hz; those beyond stand at the edge."""

LINES = {"nothing removed": "-", "mean removed": "--", "line removed": ":"}


@chart_of({"Joint": joints}, height=460)
def data_sets(study: Comparison, result: JointResult) -> tuple[Panel, ...]:
    """Bandwidth recovered from every data set by every method, with 95 % intervals."""
    series = []
    for method in METHODS:
        models = [model for model in study.data_sets[result.joint].models if model.method == method]
        for trusted, name in ((True, method.upper()), (False, f"{method.upper()}, excited too little or unstable")):
            drawn = [model for model in models if (model.stable and model.enough) is trusted]
            if not drawn:
                continue
            # A model without a bandwidth stands at the upper edge: its gain does not fall by 3 dB.
            hz = np.clip(np.nan_to_num([model.bandwidth_hz for model in drawn], nan=HERTZ[1]), *HERTZ)
            names = [model.record.removesuffix(f"-{result.joint}") for model in drawn]
            if trusted:
                low, high = np.clip([model.ci95 for model in drawn], *HERTZ).T
                look = points(method, PALETTE[method].marker)
            else:
                low, high = None, None
                look = points(method, "x")
            series.append(Series(name, hz, names, look, low, high, along=True))
    marks = (("x", result.best_linear.hz, "best linear truth"), *(("x", edge, "") for edge in ABOUT_1_HZ))
    return (Panel("bandwidth / Hz", "data set", series, "", "x", HERTZ, None, marks),)


@chart_of({"Joint": joints}, height=170)
def orders(study: Comparison, result: JointResult) -> tuple[Panel, ...]:
    """Order searches: fit to other data sets, lags outside the whiteness bounds, criteria of ARX structures."""
    searches = study.searches.get(result.joint)
    if searches is None:
        return ()
    fits, lags = [], []
    for search in (searches.armax, searches.oe):
        for label, candidates, marker in _candidates_of_search(search):
            poles, look = [candidate.poles for candidate in candidates], points(search.method, marker)
            fits.append(Series(label, poles, [candidate.held_out for candidate in candidates], look))
            lags.append(Series(label, poles, [candidate.outside for candidate in candidates], look))
    # A search begins far below where it ends: what matters is near the top.
    best = max(max(series.y) for series in fits if len(series.y))
    return (
        Panel("poles", "fit to other data sets / %", fits, y_limits=(best - 12.0, best + 1.0)),
        Panel("poles", "of 25 lags outside", lags, y_limits=(-1.0, 26.0)),
        _criteria_of_arx(searches.arx),
    )


def _candidates_of_search(search: Search) -> Iterator[tuple[str, list[Iteration], str]]:
    """Label, structures and marker of each series of a search: all tried, the chosen one, that of the thesis."""
    name, chosen = search.method.upper(), search.chosen
    yield name, [candidate for candidate in search.iterations if np.isfinite(candidate.held_out)], "."
    yield f"{name} chosen: {chosen.poles} poles, {chosen.zeros} zeros, delay {chosen.delay}", [chosen], "D"
    of_thesis = []
    if search.own and np.isfinite(search.own.held_out):
        of_thesis.append(search.own)
    yield f"{name} of the thesis", of_thesis, "*"


def _criteria_of_arx(table: StructureTable) -> Panel:
    """Smallest value of each criterion of order over the number of parameters of ARX structures."""
    sizes = np.unique(table.parameters)
    curves = []
    # AIC and BIC are logarithms of a loss with a penalty: their exponential fits on the axis of the loss.
    for name, values, colour in (
        ("loss", table.loss, "#8a8a8a"),
        ("exp(AIC)", np.exp(table.aic), "#e69f00"),
        ("exp(BIC)", np.exp(table.bic), "#0072b2"),
        ("validation", table.validation, "#d55e00"),
    ):
        smallest = [values[table.parameters == size].min() for size in sizes]
        curves.append(Series(name, sizes, smallest, Style(colour)))
    return Panel("parameters", "mean square error / rad²", curves, "best ARX structure of each size", "y")


def _disturbances(study: Comparison) -> dict[str, str]:
    """Disturbances that were tried, in the order of their table."""
    tried = {outcome.disturbance for outcome in study.robustness.outcomes}
    return {name: name for name in DISTURBANCES if name in tried}


@chart_of({"Disturbance": _disturbances}, columns=3, height=190)
def disturbed(study: Comparison, disturbance_key: str) -> tuple[Panel, ...]:
    """Error of the bandwidth, and what simulations of clean records leave, over the degree of each disturbance."""
    unit = DISTURBANCES[disturbance_key].unit
    errors, remainders = [], []
    for joint in study.robustness.judged_by:
        error_curves, remainder_curves = _curves_over_degree(study.robustness, disturbance_key, joint)
        errors.append(Panel(unit, "bandwidth over best linear truth − 1 / %", error_curves, short(joint)))
        remainders.append(Panel(unit, "100 − fit / %", remainder_curves, short(joint)))
    return (*errors, *remainders)


def _curves_over_degree(robustness: Robustness, disturbance_key: str, joint: str) -> tuple[list[Series], list[Series]]:
    """Errors of the bandwidth, and what fits leave of 100 %, of each method and treatment over the degree."""
    # A disturbance that no treatment removes is drawn once, as it is.
    treatments = LINES if DISTURBANCES[disturbance_key].treatments != AS_IT_IS else AS_IT_IS
    error_curves, remainder_curves = [], []
    for name, method, colour in (("SysID", sysid_method(joint), "armax"), ("OKID", "okid", "okid")):
        for treatment in treatments:
            curve = robustness.curve(disturbance_key, joint, method, treatment)
            if not curve:
                continue
            label = name if len(treatments) == 1 else f"{name}, {treatment}"
            look = Style(PALETTE[colour].colour, LINES[treatment], 1.4)
            degrees = list(curve)
            # Median, least and greatest over draws; the least fit leaves most.
            middle, low, high = np.array([errors for errors, _ in curve.values()]).T
            error_curves.append(Series(label, degrees, middle, look, low, high))
            middle, high, low = 100.0 - np.array([fits for _, fits in curve.values()]).T
            remainder_curves.append(Series(label, degrees, middle, look, low, high))
    return error_curves, remainder_curves

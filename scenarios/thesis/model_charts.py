"""Charts of many models: every data set, orders, disturbed records."""

import numpy as np

from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import points, short
from scenarios.thesis.chart import Panel, Series, chart_of, joints
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES
from scenarios.thesis.robustness import sysid_method
from sysid.plots import PALETTE, Style

METHODS = ("arx", "iv4", "armax", "oe", "okid")

HERTZ = (0.3, 4.0)
"""Bandwidths that are shown, Hz; those beyond stand at the edge."""

LINES = {"nothing removed": "-", "mean removed": "--", "line removed": ":"}


@chart_of({"Joint": joints}, height=460)
def data_sets(study: Comparison, entry: JointResult) -> tuple[Panel, ...]:
    """Bandwidth recovered from every data set by every method, with 95 % intervals."""
    series = []
    for method in METHODS:
        models = [model for model in study.data_sets[entry.joint].models if model.method == method]
        for trusted, name in ((True, method.upper()), (False, f"{method.upper()}, excited too little or unstable")):
            rows = [model for model in models if (model.stable and model.enough) is trusted]
            if not rows:
                continue
            hz = np.clip(np.nan_to_num([model.bandwidth_hz for model in rows], nan=HERTZ[1]), *HERTZ)
            low, high = np.clip([model.ci95 for model in rows], *HERTZ).T if trusted else (None, None)
            look = points(method, PALETTE[method].marker if trusted else "x")
            names = [model.record.removesuffix(f"-{entry.joint}") for model in rows]
            series.append(Series(name, hz, names, look, low, high, along=True))
    marks = (("x", entry.best_linear.hz, "best linear truth"), *(("x", edge, "") for edge in ABOUT_1_HZ))
    return (Panel("bandwidth / Hz", "data set", series, "", "x", HERTZ, None, marks),)


@chart_of({"Joint": joints}, height=170)
def orders(study: Comparison, entry: JointResult) -> tuple[Panel, ...]:
    """Order searches: fit to other data sets, lags outside the whiteness bounds, criteria of ARX structures."""
    known = study.searches.get(entry.joint)
    if known is None:
        return ()
    fits, lags = [], []
    for search in (known.armax, known.oe):
        name, chosen = search.method.upper(), search.chosen
        for label, rows, marker in (
            (name, [one for one in search.iterations if np.isfinite(one.held_out)], "."),
            (f"{name} chosen: {chosen.poles} poles, {chosen.zeros} zeros, delay {chosen.delay}", [chosen], "D"),
            (f"{name} of the thesis", [search.own] if search.own and np.isfinite(search.own.held_out) else [], "*"),
        ):
            poles, mark = [one.poles for one in rows], points(search.method, marker)
            fits.append(Series(label, poles, [one.held_out for one in rows], mark))
            lags.append(Series(label, poles, [one.outside for one in rows], mark))
    # A search begins far below where it ends: what matters is near the top.
    best = max(max(one.y) for one in fits if len(one.y))
    table, numbers = known.arx, np.unique(known.arx.parameters)
    least = [
        Series(name, numbers, [values[table.parameters == n].min() for n in numbers], Style(colour))
        for name, values, colour in (
            ("loss", table.loss, "#8a8a8a"),
            ("exp(AIC)", np.exp(table.aic), "#e69f00"),
            ("exp(BIC)", np.exp(table.bic), "#0072b2"),
            ("validation", table.validation, "#d55e00"),
        )
    ]
    return (
        Panel("poles", "fit to other data sets / %", fits, y_limits=(best - 12.0, best + 1.0)),
        Panel("poles", "of 25 lags outside", lags, y_limits=(-1.0, 26.0)),
        Panel("parameters", "mean square error / rad²", least, "best ARX structure of each size", "y"),
    )


def _disturbances(study: Comparison) -> dict[str, str]:
    tried = {entry.disturbance for entry in study.robustness.outcomes}
    return {name: name for name in DISTURBANCES if name in tried}


@chart_of({"Disturbance": _disturbances}, columns=3, height=190)
def disturbed(study: Comparison, kind: str) -> tuple[Panel, ...]:
    """Error of the bandwidth, and what simulations of clean records leave, over the degree of each disturbance."""
    results, disturbance, panels = study.robustness, DISTURBANCES[kind], []
    treatments = LINES if disturbance.treatments != AS_IT_IS else AS_IT_IS
    for label, fit in (("bandwidth over best linear truth − 1 / %", False), ("100 − fit / %", True)):
        for joint in results.judged_by:
            series = []
            for name, method, colour in (("SysID", sysid_method(joint), "armax"), ("OKID", "okid", "okid")):
                for treatment in treatments:
                    found = results.curve(kind, joint, method, treatment)
                    if not found:
                        continue
                    # Median, least and greatest; the least fit leaves most.
                    rows = [[100.0 - fits[k] for k in (0, 2, 1)] if fit else errors for errors, fits in found.values()]
                    look = Style(PALETTE[colour].colour, LINES[treatment], 1.4)
                    text = name if len(treatments) == 1 else f"{name}, {treatment}"
                    middle, low, high = np.array(rows).T
                    series.append(Series(text, list(found), middle, look, low, high))
            panels.append(Panel(disturbance.unit, label, series, short(joint)))
    return tuple(panels)

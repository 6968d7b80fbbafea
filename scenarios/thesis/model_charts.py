"""Charts of many models: every data set, orders, disturbed records."""

from collections.abc import Iterable

import numpy as np

from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import short
from scenarios.thesis.chart import Chart, Panel, Series, by_view
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES
from scenarios.thesis.response_charts import joints
from scenarios.thesis.robustness import Range, sysid_method
from sysid.plots import PALETTE, Style

METHODS = ("arx", "iv4", "armax", "oe", "okid")

HERTZ = (0.3, 4.0)
"""Bandwidths that are shown, Hz; those beyond stand at the edge."""

LINES = {"nothing removed": "-", "mean removed": "--", "line removed": ":"}


def data_sets(study: Comparison) -> Chart:
    """Bandwidth recovered from every data set by every method, with 95 % intervals."""

    def panels(entry: JointResult) -> tuple[Panel, ...]:
        sets = study.data_sets[entry.joint]
        series = []
        for method in METHODS:
            models = [model for model in sets.models if model.method == method]
            for trusted, name in ((True, method.upper()), (False, f"{method.upper()}, excited too little or unstable")):
                rows = [model for model in models if (model.stable and model.enough) is trusted]
                if not rows:
                    continue
                hz = np.clip(np.nan_to_num([model.bandwidth_hz for model in rows], nan=HERTZ[1]), *HERTZ)
                ends = [np.clip([model.ci95[k] for model in rows], *HERTZ) for k in (0, 1)] if trusted else [None, None]
                look = Style(PALETTE[method].colour, "", 1.0, PALETTE[method].marker if trusted else "x")
                names = [model.record.removesuffix(f"-{entry.joint}") for model in rows]
                series.append(Series(name, hz, names, look, ends[0], ends[1], along=True))
        marks = (("x", entry.best_linear.hz, "best linear truth"), *(("x", edge, "") for edge in ABOUT_1_HZ))
        return (Panel("bandwidth / Hz", "data set", tuple(series), "", "x", HERTZ, None, marks),)

    return Chart(by_view(panels, joints(study)), height=460)


def orders(study: Comparison) -> Chart:
    """Order searches: fit to other data sets, lags outside the whiteness bounds, criteria of ARX structures."""

    def panels(entry: JointResult) -> tuple[Panel, ...]:
        known = study.searches.get(entry.joint)
        if known is None:
            return ()
        fits, lags = [], []
        for search in (known.armax, known.oe):
            tried = [one for one in search.iterations if np.isfinite(one.held_out)]
            chosen, look = search.chosen, PALETTE[search.method]
            name = search.method.upper()
            for label, rows, marker in (
                (name, tried, "."),
                (f"{name} chosen: {chosen.poles} poles, {chosen.zeros} zeros, delay {chosen.delay}", [chosen], "D"),
                (f"{name} of the thesis", [search.own] if search.own in tried else [], "*"),
            ):
                poles = [one.poles for one in rows]
                mark = Style(look.colour, "", 1.0, marker)
                fits.append(Series(label, poles, [one.held_out for one in rows], mark))
                lags.append(Series(label, poles, [one.outside for one in rows], mark))
        # A search begins far below where it ends: what matters is near the top.
        best = max(max(one.y) for one in fits if len(one.y))
        table = known.arx
        criteria = [
            ("loss", table.loss, "#8a8a8a"),
            ("exp(AIC)", np.exp(table.aic), "#e69f00"),
            ("exp(BIC)", np.exp(table.bic), "#0072b2"),
            ("validation", table.validation, "#d55e00"),
        ]
        numbers = np.unique(table.parameters)
        least = tuple(
            Series(name, numbers, [values[table.parameters == n].min() for n in numbers], Style(colour))
            for name, values, colour in criteria
        )
        return (
            Panel("poles", "fit to other data sets / %", tuple(fits), "", "", None, (best - 12.0, best + 1.0)),
            Panel("poles", "of 25 lags outside", tuple(lags), y_limits=(-1.0, 26.0)),
            Panel("parameters", "mean square error / rad²", least, "best ARX structure of each size", "y"),
        )

    return Chart(by_view(panels, joints(study)), height=170)


def disturbed(study: Comparison) -> Chart:
    """Error of the bandwidth, and what simulations of clean records leave, over the degree of each disturbance."""
    results = study.robustness
    names = [name for name in DISTURBANCES if any(entry.disturbance == name for entry in results.outcomes)]

    def curves(kind: str, joint: str, fit: bool) -> tuple[Series, ...]:
        series = []
        treatments = LINES if DISTURBANCES[kind].treatments != AS_IT_IS else AS_IT_IS
        for name, method in (("SysID", sysid_method(joint)), ("OKID", "okid")):
            for treatment in treatments:
                points = results.curve(kind, joint, method, treatment)
                if not points:
                    continue
                middle, low, high = _values(points.values(), fit)
                look = Style(PALETTE["armax" if name == "SysID" else "okid"].colour, LINES[treatment], 1.4)
                label = name if len(treatments) == 1 else f"{name}, {treatment}"
                series.append(Series(label, list(points), middle, look, low, high))
        return tuple(series)

    def panels(kind: str) -> tuple[Panel, ...]:
        labels = {False: "bandwidth over best linear truth − 1 / %", True: "100 − fit / %"}
        return tuple(
            Panel(DISTURBANCES[kind].unit, label, curves(kind, joint, fit), short(joint))
            for fit, label in labels.items()
            for joint in results.judged_by
        )

    return Chart(by_view(panels, {name: name for name in names}), ("Disturbance",), columns=3, height=190)


def _values(points: Iterable[tuple[Range, Range]], fit: bool) -> tuple[np.ndarray, ...]:
    """Median, least and greatest: of 100 − fit, or of the error of the bandwidth, percent."""
    values = np.array([(100.0 - np.array(fits)[[0, 2, 1]]) if fit else errors for errors, fits in points]).reshape(
        -1, 3
    )
    return tuple(values.T)

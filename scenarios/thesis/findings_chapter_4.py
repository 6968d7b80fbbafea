"""Findings of chapter IV, F8 to F13: prediction-error models of single joints."""

from collections.abc import Mapping

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.every_data_set import DataSetModel, DataSets, distances
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, words
from scenarios.thesis.number_text import minus, p_value
from scenarios.thesis.verdicts import MARGIN, ahead
from scenarios.truth.published import EQUATIONS
from sysid import StateSpace

COMPARED = ("armax", "oe")
"""Methods that the thesis chooses between."""

REJECTED = 0.01
"""p-value below which whiteness or independence is rejected."""

DISMISSED = ("arx", "iv4")
"""Methods that it had dismissed before."""


def flexibility(study: Comparison, joint: str) -> dict[str, float]:
    """Median fits to tests of other waveforms, percent, by method in capitals; minus infinity of an unstable model."""
    fits: dict[str, float] = {}
    for method in (*COMPARED, *DISMISSED):
        model = study.data_sets[joint].find(single_joint_test(study.estimation_test, joint), method)
        if model is None or not model.others:
            raise MissingRecordError(f"{words(joint)}: no {method.upper()} model to judge on other tests")
        fits[method.upper()] = model.others_simulation if model.stable else -np.inf
    return fits


def best(fits: Mapping[str, float], method: str, other: str) -> bool:
    """Whether one of two methods is ahead of the other by more than a tie; two unstable models are level."""
    return fits[method] > fits[other] and ahead(fits[method] - fits[other])


def comparison_text(fits: Mapping[str, float], method: str) -> str:
    """A method against the others, percentage points, in words."""
    leads = [
        f"{name} is {'unstable' if np.isinf(fit) else minus(f'{fit - fits[method]:+.2f} points from it')}"
        for name, fit in fits.items()
        if name != method
    ]
    own = "unstable" if np.isinf(fits[method]) else f"at {fits[method]:.2f} %"
    return f"{method} is {own} on the tests not seen; {', '.join(leads)}; less than {MARGIN:g} points are a tie"


def consistency(study: Comparison) -> Finding:
    """F8: ARX and IV4 give inconsistent models from one data set to the next, ARMAX and OE do not."""
    parts: dict[str, bool] = {}
    value: dict[str, float] = {}
    notes = []
    for joint, entry in study.data_sets.items():
        spread = {method: data_set_spread(entry, method) for method in (*COMPARED, *DISMISSED)}
        unstable = {method: sum(not m.stable for m in entry.singles(method, enough=True)) for method in spread}
        limit = CLAIMS["F8"].limits["further"] * max(spread[method] for method in COMPARED)
        for method in DISMISSED:
            inconsistent = unstable[method] > 0 or spread[method] >= limit
            parts[f"{method.upper()} on {joint}"] = inconsistent and not any(unstable[other] for other in COMPARED)
        value |= {f"{words(joint)} {method.upper()}": number for method, number in spread.items()}
        counts = [f"{count} {method.upper()}" for method, count in unstable.items() if count]
        notes.append(f"{words(joint)} {' and '.join(counts) or 'none'}")
    return decided_finding("F8", parts, value, {"unstable": notes})


def data_set_spread(entry: DataSets, method: str) -> float:
    """Median relative distance between the responses of a method's models from data sets that excite enough."""
    apart = distances(entry.singles(method, enough=True))
    if not len(apart):
        joint, name = words(entry.joint), method.upper()
        raise MissingRecordError(f"{joint}: fewer than two data sets from which {name} was identified")
    return float(np.median(apart))


def yaw_armax(study: Comparison) -> Finding:
    """F9: the yaw ARMAX has white, independent residuals and a near cancellation."""
    model = study.joints["shoulder_yaw"].models["armax"]
    distance, printed = nearest(model.estimate.model), nearest(EQUATIONS["4.7"].model)
    test = model.residual_test
    parts = {"white": test.white[0], "independent": test.independent[0, 0], "near cancellation": distance <= printed}
    value = {
        "whiteness p": test.whiteness_p[0],
        "independence p": test.independence_p[0, 0],
        "largest autocorrelation over its bound": np.abs(test.autocorrelation[1:, 0, 0]).max() / test.whiteness_bound,
        "nearest pole and zero": distance,
    }
    facts = {
        "outside": int(test.outside_whiteness[0]),
        "printed": printed,
        "own": model.fits[study.estimation_test].one_step,
        "friction": _friction(study, "shoulder_yaw", "armax", "whiteness_p", "independence_p"),
    }
    return decided_finding("F9", parts, value, facts)


def yaw_oe(study: Comparison) -> Finding:
    """F10: the yaw OE has residuals that are not white, and more poles turn unstable."""
    model = study.joints["shoulder_yaw"].models["oe"]
    models = study.more_poles
    poles = int(np.max(model.estimate.orders["nf"]))
    own_unstable = any(entry.unstable for entry in models if entry.orders[1] == poles)
    more = [entry for entry in models if entry.orders[1] > poles]
    gone = [f"{entry.orders[0] - 1} zero(s) and {entry.orders[1]} poles" for entry in more if entry.unstable]
    parts = {
        "not white": not model.residual_test.white[0],
        "more poles unstable": 2 * len(gone) > len(more) and not own_unstable,
    }
    value = {
        "whiteness p": model.residual_test.whiteness_p[0],
        "structures with more poles that turn unstable": len(gone),
        "of": len(more),
        "largest modulus of a pole, kept stable": max(entry.radius for entry in more),
        "largest modulus of a pole, left free": max(entry.free_radius for entry in more),
    }
    named = f" ({', '.join(gone)})" if gone else ""
    named += " and the thesis' own orders too" if own_unstable else ""
    return decided_finding("F10", parts, value, {"gone": len(gone), "more": len(more), "named": named})


def shoulder_oe(study: Comparison) -> Finding:
    """F11: on the shoulder pitch OE is best, its residuals independent of the input."""
    fits = flexibility(study, "shoulder_pitch")
    model = study.joints["shoulder_pitch"].models["oe"]
    independent = model.residual_test.independent[0, 0]
    facts = {
        "compared": comparison_text(fits, "OE"),
        "independent": "" if independent else "not ",
        "left": 100 - model.fits[study.estimation_test].simulation,
        "friction": _friction(study, "shoulder_pitch", "oe", "independence_p"),
    }
    value = {**fits, "independence p": model.residual_test.independence_p[0, 0]}
    return decided_finding("F11", {"OE best": best(fits, "OE", "ARMAX"), "independent": independent}, value, facts)


def elbow_armax(study: Comparison) -> Finding:
    """F12: on the elbow pitch ARMAX is best, and whiter than OE."""
    fits = flexibility(study, "elbow_pitch")
    models = study.joints["elbow_pitch"].models
    correlations = {name: models[name].residual_test.autocorrelation[1:, 0, 0] for name in COMPARED}
    colour = {f"{name.upper()} autocorrelation": np.sqrt(np.mean(r**2)) for name, r in correlations.items()}
    armax, oe = colour.values()
    parts = {"ARMAX best": best(fits, "ARMAX", "OE"), "whiter": armax < oe}
    return decided_finding("F12", parts, fits | colour, {"compared": comparison_text(fits, "ARMAX")})


def stable(study: Comparison) -> Finding:
    """F13: all models are stable."""
    radius = {joint: max(m.radius for m in entry.models.values()) for joint, entry in study.joints.items()}
    compared, beyond, aside = "ARMAX, OE and OKID", "ARMAX, OE and OKID, too little excitation", "ARX and IV4"
    groups: dict[str, list[DataSetModel]] = {compared: [], beyond: [], aside: []}
    for entry in study.data_sets.values():
        for model in entry.singles():
            enough = beyond if (entry.excited[model.record].file or 0) < model.needed else compared
            groups[aside if model.method in DISMISSED else enough].append(model)
    unstable = {
        name: [f"{model.method.upper()} from {model.record}" for model in models if not model.stable]
        for name, models in groups.items()
    }
    counts = {
        f"{what}{name}": len(models[name])
        for name in groups
        for what, models in (("unstable ", unstable), ("of ", groups))
    }
    parts = {f"estimation test, {joint}": value < 1 for joint, value in radius.items()}
    facts = {"compared": unstable[compared] or "none", "beyond": unstable[beyond] or "none"}
    return decided_finding("F13", {**parts, "every data set": not unstable[compared]}, radius | counts, facts)


def nearest(model: StateSpace) -> float:
    """Distance between the nearest pole and zero in the z plane, delays (roots at the origin) aside."""
    path = model.input_path()
    poles, zeros = path.poles(), path.zeros()
    poles, zeros = poles[np.abs(poles) > 1e-6], zeros[np.abs(zeros) > 1e-6]
    return float(np.abs(poles[:, None] - zeros[None, :]).min(initial=np.inf))


def _friction(study: Comparison, joint: str, method: str, *tests: str) -> str:
    """What friction does to tests of residuals, by models of the arm without it; empty where that was not played."""
    own = single_joint_test(study.estimation_test, joint)
    smooth = study.frictionless[joint].find(own, method)
    if smooth is None:
        return ""
    values = {name.removesuffix("_p"): float(getattr(smooth.residual_test, name).flat[0]) for name in tests}
    listed = ", ".join(f"{name} {p_value(p)}" for name, p in values.items())
    passed = min(values.values()) >= REJECTED
    effect = "makes the residuals fail" if passed else "is not all that makes residuals fail"
    return f"identified on the arm without friction the same structure has {listed}, so friction {effect}"

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
        # An unstable model follows no record in simulation: it ranks behind all others.
        fits[method.upper()] = model.others_simulation if model.stable else -np.inf
    return fits


def best(fits: Mapping[str, float], method: str, rival: str) -> bool:
    """Whether a method is ahead of its rival by more than a tie; two unstable models are level."""
    # The first condition keeps away the difference of two infinities, which is NaN.
    return fits[method] > fits[rival] and ahead(fits[method] - fits[rival])


def comparison_text(fits: Mapping[str, float], method: str) -> str:
    """A method against the others, percentage points, in words."""
    rivals = []
    for rival, fit in fits.items():
        if rival == method:
            continue
        difference = minus(f"{fit - fits[method]:+.2f} points from it")
        rivals.append(f"{rival} is unstable" if np.isinf(fit) else f"{rival} is {difference}")
    level = "unstable" if np.isinf(fits[method]) else f"at {fits[method]:.2f} %"
    return f"{method} is {level} on the tests not seen; {', '.join(rivals)}; less than {MARGIN:g} points are a tie"


def consistency(study: Comparison) -> Finding:
    """F8: ARX and IV4 give inconsistent models from one data set to the next, ARMAX and OE do not."""
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    unstable_by_joint = []
    for joint, data_sets in study.data_sets.items():
        spread: dict[str, float] = {}
        unstable: dict[str, int] = {}
        for method in (*COMPARED, *DISMISSED):
            spread[method] = data_set_spread(data_sets, method)
            unstable[method] = sum(not model.stable for model in data_sets.singles(method, enough=True))
        # If ARMAX or OE too were unstable, inconsistency would be no mark of ARX and IV4.
        compared_stable = not any(unstable[method] for method in COMPARED)
        limit = CLAIMS["F8"].limits["further"] * max(spread[method] for method in COMPARED)
        for method in DISMISSED:
            inconsistent = unstable[method] > 0 or spread[method] >= limit
            verdict_parts[f"{method.upper()} on {joint}"] = inconsistent and compared_stable
        values |= {f"{words(joint)} {method.upper()}": distance for method, distance in spread.items()}
        counts = [f"{count} {method.upper()}" for method, count in unstable.items() if count]
        unstable_by_joint.append(f"{words(joint)} {' and '.join(counts) or 'none'}")
    return decided_finding("F8", verdict_parts, values, {"unstable": unstable_by_joint})


def data_set_spread(data_sets: DataSets, method: str) -> float:
    """Median relative distance between the responses of a method's models from data sets that excite enough."""
    pair_distances = distances(data_sets.singles(method, enough=True))
    if not len(pair_distances):
        joint, name = words(data_sets.joint), method.upper()
        raise MissingRecordError(f"{joint}: fewer than two data sets from which {name} was identified")
    return float(np.median(pair_distances))


def yaw_armax(study: Comparison) -> Finding:
    """F9: the yaw ARMAX has white, independent residuals and a near cancellation."""
    model = study.joints["shoulder_yaw"].models["armax"]
    # The thesis calls the cancellation of its model (4.7) near and gives no distance: that of its print is the limit.
    distance, printed = nearest(model.estimate.model), nearest(EQUATIONS["4.7"].model)
    test = model.residual_test
    verdict_parts = {
        "white": test.white[0],
        "independent": test.independent[0, 0],
        "near cancellation": distance <= printed,
    }
    largest_autocorrelation = np.abs(test.autocorrelation[1:, 0, 0]).max()
    values = {
        "whiteness p": test.whiteness_p[0],
        "independence p": test.independence_p[0, 0],
        "largest autocorrelation over its bound": largest_autocorrelation / test.whiteness_bound,
        "nearest pole and zero": distance,
    }
    facts = {
        "outside": int(test.outside_whiteness[0]),
        "printed": printed,
        "own": model.fits[study.estimation_test].one_step,
        "friction": friction_text(study, "shoulder_yaw", "armax", "whiteness_p", "independence_p"),
    }
    return decided_finding("F9", verdict_parts, values, facts)


def yaw_oe(study: Comparison) -> Finding:
    """F10: the yaw OE has residuals that are not white, and more poles turn unstable."""
    model = study.joints["shoulder_yaw"].models["oe"]
    poles = int(np.max(model.estimate.orders["nf"]))
    thesis_orders_unstable = any(tried.unstable for tried in study.more_poles if tried.orders[1] == poles)
    larger = [tried for tried in study.more_poles if tried.orders[1] > poles]
    unstable = []
    for tried in larger:
        if tried.unstable:
            nb, nf = tried.orders[:2]
            unstable.append(f"{nb - 1} zero(s) and {nf} poles")
    # More than half, not just any: the thesis says it of various tests without exception. If its own orders turn
    # unstable as well, the number of poles is not the cause.
    verdict_parts = {
        "not white": not model.residual_test.white[0],
        "more poles unstable": 2 * len(unstable) > len(larger) and not thesis_orders_unstable,
    }
    values = {
        "whiteness p": model.residual_test.whiteness_p[0],
        "structures with more poles that turn unstable": len(unstable),
        "of": len(larger),
        "largest modulus of a pole, kept stable": max(tried.radius for tried in larger),
        "largest modulus of a pole, left free": max(tried.free_radius for tried in larger),
    }
    named = f" ({', '.join(unstable)})" if unstable else ""
    if thesis_orders_unstable:
        named += " and the thesis' own orders too"
    facts = {"gone": len(unstable), "more": len(larger), "named": named}
    return decided_finding("F10", verdict_parts, values, facts)


def shoulder_oe(study: Comparison) -> Finding:
    """F11: on the shoulder pitch OE is best, its residuals independent of the input."""
    fits = flexibility(study, "shoulder_pitch")
    model = study.joints["shoulder_pitch"].models["oe"]
    independent = model.residual_test.independent[0, 0]
    negation = "" if independent else "not "
    facts = {
        "compared": comparison_text(fits, "OE"),
        "independent": negation,
        "left": 100 - model.fits[study.estimation_test].simulation,
        "friction": friction_text(study, "shoulder_pitch", "oe", "independence_p"),
    }
    verdict_parts = {"OE best": best(fits, "OE", "ARMAX"), "independent": independent}
    values = {**fits, "independence p": model.residual_test.independence_p[0, 0]}
    return decided_finding("F11", verdict_parts, values, facts)


def elbow_armax(study: Comparison) -> Finding:
    """F12: on the elbow pitch ARMAX is best, and whiter than OE."""
    fits = flexibility(study, "elbow_pitch")
    models = study.joints["elbow_pitch"].models
    autocorrelations: dict[str, float] = {}
    for method in COMPARED:
        # Lag 0 is one by definition.
        coefficients = models[method].residual_test.autocorrelation[1:, 0, 0]
        autocorrelations[f"{method.upper()} autocorrelation"] = np.sqrt(np.mean(coefficients**2))
    armax, oe = autocorrelations.values()
    verdict_parts = {"ARMAX best": best(fits, "ARMAX", "OE"), "whiter": armax < oe}
    return decided_finding("F12", verdict_parts, fits | autocorrelations, {"compared": comparison_text(fits, "ARMAX")})


def stable(study: Comparison) -> Finding:
    """F13: all models are stable."""
    radius = {}
    for joint, result in study.joints.items():
        radius[joint] = max(model.radius for model in result.models.values())
    compared, too_little, dismissed = (
        "ARMAX, OE and OKID",
        "ARMAX, OE and OKID, too little excitation",
        "ARX and IV4",
    )
    groups: dict[str, list[DataSetModel]] = {compared: [], too_little: [], dismissed: []}
    for data_sets in study.data_sets.values():
        for model in data_sets.singles():
            if model.method in DISMISSED:
                groups[dismissed].append(model)
            elif (data_sets.excited[model.record].file or 0) < model.needed:
                groups[too_little].append(model)
            else:
                groups[compared].append(model)
    unstable: dict[str, list[str]] = {}
    counts: dict[str, float] = {}
    for name, models in groups.items():
        unstable[name] = [f"{model.method.upper()} from {model.record}" for model in models if not model.stable]
        counts[f"unstable {name}"] = len(unstable[name])
        counts[f"of {name}"] = len(models)
    verdict_parts = {f"estimation test, {joint}": modulus < 1 for joint, modulus in radius.items()}
    # Only models that the thesis kept and that its data could determine decide; the other groups stand beside.
    verdict_parts["every data set"] = not unstable[compared]
    facts = {"compared": unstable[compared] or "none", "beyond": unstable[too_little] or "none"}
    return decided_finding("F13", verdict_parts, radius | counts, facts)


def nearest(model: StateSpace) -> float:
    """Distance between the nearest pole and zero in the z plane, delays (roots at the origin) aside."""
    path = model.input_path()
    poles, zeros = path.poles(), path.zeros()
    # Rounding moves a root at the origin by far less than 1e-6.
    poles, zeros = poles[np.abs(poles) > 1e-6], zeros[np.abs(zeros) > 1e-6]
    return float(np.abs(poles[:, None] - zeros[None, :]).min(initial=np.inf))


def friction_text(study: Comparison, joint: str, method: str, *tests: str) -> str:
    """What friction does to tests of residuals, by models of the arm without it; empty where that was not played."""
    record = single_joint_test(study.estimation_test, joint)
    frictionless = study.frictionless[joint].find(record, method)
    if frictionless is None:
        return ""
    values = {name.removesuffix("_p"): float(getattr(frictionless.residual_test, name).flat[0]) for name in tests}
    listed = ", ".join(f"{name} {p_value(p)}" for name, p in values.items())
    # A test that passes without friction fails because of it.
    passed = min(values.values()) >= REJECTED
    effect = "makes the residuals fail" if passed else "is not all that makes residuals fail"
    return f"identified on the arm without friction the same structure has {listed}, so friction {effect}"

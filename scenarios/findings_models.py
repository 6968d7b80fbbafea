"""Findings of chapters IV to VI, on the identified models."""

from statistics import median

import numpy as np

from scenarios.comparison import Comparison, JointResult, ModelResult
from scenarios.finding import Finding, verdict
from sysid import StateSpace

ABOUT_1_HZ = (0.8, 1.25)
"""What counts as about 1 Hz, Hz."""


def held_out(study: Comparison, model: ModelResult) -> float:
    """Median fit in simulation to the tests that the model has not seen, percent."""
    return median(fit.simulation for fit in model.held_out(study.estimation_test))


TINY = 1e-300
"""Probabilities below this are printed as such: the tail of the distribution is not computed further."""


def p_value(p: float) -> str:
    """A probability as text."""
    return f"p < {TINY:g}" if p < TINY else f"p = {p:.2g}"


def yaw_armax(study: Comparison) -> Finding:
    """F9: the yaw ARMAX has white, independent residuals and a near cancellation."""
    model = study.joints["shoulder_yaw"].models["armax"]
    poles, zeros = model.estimate.model.poles(), model.estimate.model.zeros()
    poles, zeros = poles[np.abs(poles) > 1e-6], zeros[np.abs(zeros) > 1e-6]
    nearest = float(np.abs(poles[:, None] - zeros[None, :]).min(initial=np.inf))
    test = model.residual_test
    parts = [bool(test.white[0]), bool(test.independent[0, 0]), nearest < 0.1]
    return Finding(
        "F9",
        "yaw: ARMAX with 5 poles, 2 zeros, 2 delays has white, independent residuals and a near pole-zero cancellation",
        "IV.3A",
        verdict(sum(parts), len(parts)),
        {
            "whiteness p": float(test.whiteness_p[0]),
            "independence p": float(test.independence_p[0, 0]),
            "nearest pole and zero": nearest,
        },
        "p-values at 25 lags (below 0.01: rejected); distance in the z plane (below 0.1: near)",
        "white, independent, one near cancellation",
        "the tests grow sharper with every sample; how much of the departure is friction is not told apart here",
    )


def yaw_oe(study: Comparison) -> Finding:
    """F10: the yaw OE has residuals that are not white."""
    test = study.joints["shoulder_yaw"].models["oe"].residual_test
    return Finding(
        "F10",
        "yaw: the residuals of OE (2 poles, 1 zero, 2 delays) are not white; OE with more poles turns unstable",
        "IV.3A",
        "not reproduced" if test.white[0] else "partly",
        float(test.whiteness_p[0]),
        "p-value of whiteness at 25 lags",
        "not white",
        "an output-error model leaves all disturbance dynamics in its residuals; that more poles turn unstable cannot "
        "be told here, because the estimator keeps every model stable",
    )


def best_structure(study: Comparison, key: str, joint: str, best: str, other: str, claim: str) -> Finding:
    """F11 and F12: which of OE and ARMAX is best on a pitch joint."""
    models = study.joints[joint].models
    fits = {name: held_out(study, models[name]) for name in (best, other)}
    better = fits[best] >= fits[other]
    if key == "F11":
        second = bool(models[best].residual_test.independent[0, 0])
        p = float(models[best].residual_test.independence_p[0, 0])
        said = (
            f"its residuals are {'' if second else 'not '}independent of the input ({p_value(p)}; below 0.01: rejected)"
        )
    else:
        outside = {name: int(models[name].residual_test.outside_whiteness[0]) for name in (best, other)}
        second = outside[best] < outside[other]
        said = (
            f"{outside[best]} of 25 lags lie outside the whiteness bounds for {best.upper()}, "
            f"{outside[other]} for {other.upper()}; white residuals would leave 0.25 outside by chance, 1 % of the lags"
        )
    return Finding(
        key,
        claim,
        "IV.4",
        verdict(int(better) + int(second), 2),
        {name.upper(): value for name, value in fits.items()},
        "percent, median simulation fit to the seven tests not seen",
        f"{best.upper()} best",
        said,
    )


def stable(study: Comparison) -> Finding:
    """F13: all models are stable."""
    radius = {
        name: max(float(np.abs(m.estimate.model.poles()).max()) for m in entry.models.values())
        for name, entry in study.joints.items()
    }
    return Finding(
        "F13",
        "all models are stable",
        "IV, V, VI.3",
        verdict(sum(value < 1 for value in radius.values()), len(radius)),
        radius,
        "largest modulus of a pole over all models",
        "below one",
        "OE keeps its F stable by construction; ARMAX and OKID are free to be unstable and are not",
    )


def percent_described(study: Comparison) -> Finding:
    """F14: order 2 describes 96 to 99.9 percent in OKID's own measure."""
    found = {
        name: _described(entry.models["okid"].estimate.diagnostics["percent_described"])
        for name, entry in study.joints.items()
    }
    printed = {"shoulder_yaw": 99.87, "shoulder_pitch": 96.11, "elbow_pitch": 98.88}
    fits = ", ".join(f"{held_out(study, entry.models['okid']):.1f} %" for entry in study.joints.values())
    return Finding(
        "F14",
        "OKID from PRBS with p = 5: order 2 describes 99.87 % (yaw), 96.11 % (shoulder), 98.88 % (elbow) of the data",
        "V.2, V.3",
        verdict(sum(found[name] >= printed[name] - 0.5 for name in found), len(found)),
        found,
        "percent of the squared Hankel singular values that two states hold",
        "99.87, 96.11, 98.88",
        "half a point below the printed share is allowed, any share above it passes; this measure says how "
        "much of the Hankel matrix two states hold and is no fit; median simulation fits to "
        f"tests not seen are {fits}",
    )


def _described(value: object) -> float:
    """The share at order 2, whether the estimator gives one number or one for each order."""
    entries = np.atleast_1d(np.asarray(value, dtype=float))
    return float(entries[1] if entries.size > 1 else entries[0])


def real_poles(study: Comparison) -> Finding:
    """F16: OKID has real poles and complex zeros, the SysID model has complex poles."""
    okid = [entry.models["okid"].estimate.model for entry in study.joints.values()]
    own = [entry.chosen.estimate.model for entry in study.joints.values()]
    parts = [
        not any(_complex(model.poles()) for model in okid),
        all(_complex(model.zeros()) for model in okid),
        any(_complex(model.poles()) for model in own),
    ]
    counts = {
        "OKID complex poles": float(sum(_complex(model.poles()) for model in okid)),
        "OKID complex zeros": float(sum(_complex(model.zeros()) for model in okid)),
        "SysID complex poles": float(sum(_complex(model.poles()) for model in own)),
    }
    return Finding(
        "F16",
        "OKID poles are all real and its transmission zeros complex pairs; the SysID model has complex poles",
        "VI.3",
        verdict(sum(parts), len(parts)),
        counts,
        "number of roots with an imaginary part, three joints",
        "0; all; some",
        "two states stand for all of the truth's, so their zeros are what truncation leaves of the delay and the fast "
        "poles, not zeros of the arm. The dominant poles of the truth are real too, so complex "
        "ones in a model are not the arm's slow dynamics",
    )


def _complex(roots: np.ndarray) -> int:
    return int((np.abs(roots.imag) > 1e-6).sum())


def bode_agrees(study: Comparison) -> Finding:
    """F17: the Bode plots of the two three-joint models agree."""
    f = np.geomspace(0.1, 5.0, 100)
    found = {
        name: _decibels_apart(entry.chosen.estimate.model, entry.models["okid"].estimate.model, f)
        for name, entry in study.joints.items()
    }
    return Finding(
        "F17",
        "the Bode plots of the SysID and the OKID model agree",
        "VI.2",
        verdict(sum(value < 3.0 for value in found.values()), len(found)),
        found,
        "dB, largest difference of gain from 0.1 to 5 Hz",
        "comparable",
        "3 dB is taken as agreement",
    )


def _decibels_apart(one: StateSpace, other: StateSpace, f: np.ndarray) -> float:
    gains = [np.abs(model.frequency_response(f)[:, 0, 0]) for model in (one, other)]
    return float(np.abs(20 * np.log10(gains[0] / gains[1])).max())


def follows_5_hz(study: Comparison) -> Finding:
    """F22: cutoff about 1 Hz, yet the models follow 3 to 5 Hz content."""
    low, high = ABOUT_1_HZ
    fits = {
        name: min(entry.chosen.fits[number].simulation for number in (1, 2, 3) if number in entry.chosen.fits)
        for name, entry in study.joints.items()
    }
    bands = [entry.chosen.bandwidth_hz for entry in study.joints.values()]
    passed = sum(value > 80 for value in fits.values()) + sum(low <= hz <= high for hz in bands)
    shown = ", ".join(f"{hz:.2f}" for hz in bands)
    return Finding(
        "F22",
        "cutoff about 1 Hz per joint, yet the models follow data with 3-5 Hz content",
        "VI.6",
        verdict(passed, len(fits) + len(bands)),
        fits,
        "percent, worst simulation fit of the chosen model to the tests with 5 Hz content (1 to 3)",
        "follow",
        f"the cutoff is so by construction: servo poles were placed after the published models. Bandwidths {shown} Hz "
        f"({low:g} to {high:g} is about 1); a fit above 80 % is taken as following: above its bandwidth a linear model "
        "still knows by how much the arm lags",
    )


def above_5_hz(study: Comparison) -> Finding:
    """F23: above 5 Hz OKID is slightly better."""
    found = {
        name: entry.models["okid"].fits[8].simulation - entry.chosen.fits[8].simulation
        for name, entry in study.joints.items()
        if 8 in entry.chosen.fits
    }
    ahead = ", ".join(
        f"{entry.models['okid'].fits[8].one_step - entry.chosen.fits[8].one_step:+.1f}"
        for entry in study.joints.values()
        if 8 in entry.chosen.fits
    )
    return Finding(
        "F23",
        "above 5 Hz OKID is slightly better on every joint",
        "VI.6",
        verdict(sum(value > 0 for value in found.values()), len(found)),
        found,
        "percentage points, simulation fit of OKID less that of the SysID model, 5-10 Hz chirp",
        "slightly better",
        f"one step ahead the differences are {ahead}; a model with K = 0 cannot predict, so its one-step fit is a "
        "simulation",
    )


def parsimony(study: Comparison) -> Finding:
    """F24: two states each do as well as five, two and three."""
    found = {
        name: held_out(study, entry.models["okid"]) - held_out(study, entry.chosen)
        for name, entry in study.joints.items()
    }
    orders = "/".join(str(entry.models["okid"].estimate.model.order) for entry in study.joints.values())
    own = "/".join(str(_states(entry)) for entry in study.joints.values())
    return Finding(
        "F24",
        "parsimony: orders 2/2/2 (OKID) against 5/2/3 (SysID)",
        "VI.6",
        verdict(sum(value > -1.0 for value in found.values()), len(found)),
        found,
        "percentage points, median held-out simulation fit of OKID less that of the SysID model",
        "2/2/2 suffice",
        f"the orders are {orders} against {own}; they are imposed, what the twin decides is whether fewer states cost "
        "fit (a point is allowed)",
    )


def _states(entry: JointResult) -> int:
    return entry.chosen.estimate.model.order

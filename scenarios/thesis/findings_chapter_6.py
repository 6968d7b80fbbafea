"""Findings of chapter VI, on the two three-joint models."""

import numpy as np

from hmtb_twin import JOINTS
from scenarios.thesis.about_1_hz import ABOUT_1_HZ
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.held_out import held_out
from sysid import StateSpace


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
    return decided(
        "F16",
        verdict(sum(parts), len(parts)),
        counts,
        "number of roots with an imaginary part, three joints",
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
    return decided(
        "F17",
        verdict(sum(value < 3.0 for value in found.values()), len(found)),
        found,
        "dB, largest difference of gain from 0.1 to 5 Hz",
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
    return decided(
        "F22",
        verdict(passed, len(fits) + len(bands)),
        fits,
        "percent, worst simulation fit of the chosen model to the tests with 5 Hz content (1 to 3)",
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
    return decided(
        "F23",
        verdict(sum(value > 0 for value in found.values()), len(found)),
        found,
        "percentage points, simulation fit of OKID less that of the SysID model, 5-10 Hz chirp",
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
    return decided(
        "F24",
        verdict(sum(value > -1.0 for value in found.values()), len(found)),
        found,
        "percentage points, median held-out simulation fit of OKID less that of the SysID model",
        f"the orders are {orders} against {own}; they are imposed, what the twin decides is whether fewer states cost "
        "fit (a point is allowed)",
    )


def _states(entry: JointResult) -> int:
    return entry.chosen.estimate.model.order


def coupling(study: Comparison) -> Finding:
    """F26: little coupling between the joints."""
    found = {}
    for name, entry in study.joints.items():
        log = study.logs[entry.data[study.estimation_test].name]
        spread = {other: float(np.std(log.true_angles[:, JOINTS.index(other)])) for other in study.joints}
        found[name] = 100 * max(value for other, value in spread.items() if other != name) / spread[name]
    return decided(
        "F26",
        verdict(sum(value < 10.0 for value in found.values()), len(found)),
        found,
        "percent: largest motion of another studied joint over that of the excited one, PRBS test",
        "a tenth is taken as little; the true coupled model gives "
        f"{100 * _off_diagonal(study):.1f} % of the response off the diagonal, 0.1 to 10 Hz",
    )


def _off_diagonal(study: Comparison) -> float:
    f = np.geomspace(0.1, 10.0, 200)
    chosen = [JOINTS.index(name) for name in study.joints]
    response = study.truth.model.frequency_response(f)[:, chosen][:, :, chosen]
    apart = response * ~np.eye(len(chosen), dtype=bool)
    return float(np.linalg.norm(apart) / np.linalg.norm(response))

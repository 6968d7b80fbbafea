"""F50 to F57 and F68: verdicts on OKID, on studies of which the claim is true and of which it is not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS
from scenarios.thesis import findings_observer as findings
from scenarios.thesis.estimates import Fits
from sysid import StateSpace
from tests.scenarios.thesis.altered import estimated, whiteness, with_model_of_joints

YAW, SHOULDER, ELBOW = STUDIED_JOINTS
POLE = 0.95


def _one_pole(gain):
    return StateSpace([[POLE]], [[1.0 - POLE]], [[1.0]], [[0.0]], [[gain]], 0.02)


@pytest.mark.parametrize(("gain", "verdict"), [(POLE, "reproduced"), (0.5, "not reproduced")])
def test_eigenvalues_of_the_observer_decide_whether_it_is_deadbeat(study, gain, verdict):
    changed = with_model_of_joints(study, "okid", lambda model: {"estimate": estimated(_one_pole(gain))})
    decided = findings.deadbeat(changed)
    assert decided.verdict == verdict
    assert decided.value[YAW] == pytest.approx(abs(POLE - gain), abs=1e-12)


def _observer(parameters):
    """An estimate of one slow pole with these Markov parameters of its observer."""
    columns = np.asarray(parameters, dtype=float)[:, None, None]
    diagnostics = {"observer_markov_u": columns, "observer_markov_y": columns}
    return SimpleNamespace(model=_one_pole(0.5), diagnostics=diagnostics)


@pytest.mark.parametrize(
    ("long", "verdict"), [(0.5 ** np.arange(50), "reproduced"), (POLE ** np.arange(50), "not reproduced")]
)
def test_an_observer_that_is_cut_off_does_not_count_as_fast(study, monkeypatch, long, verdict):
    """The mean lag of one slow pole is 20; that of five parameters is at most three."""
    changed = with_model_of_joints(study, "okid", lambda model: {"estimate": _observer(np.ones(5))})
    monkeypatch.setattr(findings, "observer", lambda record, order, p: _observer(long))
    decided = findings.observer_decays_faster(changed)
    assert decided.value[f"{YAW}, p = 5"] == pytest.approx(20 / 3, rel=0.01)
    slow = decided.value[f"{YAW}, p = 50"]
    assert decided.verdict == ("reproduced" if slow >= 2.0 else "not reproduced")
    assert decided.verdict == verdict
    assert "By construction, and not counted: with p = 5 on every joint" in decided.why


def test_the_mean_lag_of_a_pole_is_that_of_its_decay():
    assert findings.mean_lag(POLE ** np.arange(2000)) == pytest.approx(1 / (1 - POLE))
    assert findings.mean_lag(np.array([0.0, -3.0])) == 2.0


@pytest.mark.parametrize(
    ("yaw", "smooth", "verdict"), [(8, 3, "reproduced"), (8, 8, "partly"), (2, 2, "not reproduced")]
)
def test_parameters_are_counted_with_and_without_friction(study, monkeypatch, yaw, smooth, verdict):
    with_friction = {id(study.campaign.own(joint)) for joint in STUDIED_JOINTS}

    def needed(record):
        count = {YAW: yaw}.get(next(joint for joint in STUDIED_JOINTS if record.name.endswith(joint)), 4)
        return count if id(record) in with_friction else smooth

    monkeypatch.setattr(findings, "markov_parameters_needed", needed)
    assert findings.many_parameters(study).verdict == verdict


@pytest.mark.parametrize(
    ("below", "above", "verdict"), [(1.0, 0.5, "reproduced"), (1.0, 1.0, "partly"), (0.5, 1.0, "not reproduced")]
)
def test_validity_is_told_on_both_sides_of_1_hz(study, monkeypatch, below, above, verdict):
    model = study.joints[YAW].models["okid"].estimate.model

    def truth(result, frequencies):
        # Both bands contain 1 Hz.
        factor = above if frequencies.max() > 1.5 else below
        return factor * model.frequency_response(frequencies)[:, 0, 0]

    monkeypatch.setattr(findings, "best_linear_at", truth)
    assert findings.valid_below_1_hz(study).verdict == verdict


def _okid_fits(study, test, simulation, one_step):
    return with_model_of_joints(study, "okid", lambda model: {"fits": {**model.fits, test: Fits(simulation, one_step)}})


@pytest.mark.parametrize(
    ("simulation", "one_step", "verdict"),
    [
        (96.0, 99.0, "reproduced"),
        (80.0, 99.0, "depends on the reading"),
        (80.0, 94.0, "not reproduced"),
        (96.0, 97.0, "depends on the reading"),
    ],
)
def test_predicting_well_is_more_than_standing_still(study, monkeypatch, simulation, one_step, verdict):
    monkeypatch.setattr(findings, "unchanged_fit", lambda record: 98.0)
    assert findings.predicts_own_record(_okid_fits(study, 5, simulation, one_step)).verdict == verdict


@pytest.mark.parametrize(
    ("simulation", "one_step", "verdict"),
    [
        (95.0, 99.0, "reproduced"),
        (85.0, 85.0, "partly"),
        (50.0, 95.0, "depends on the reading"),
        (50.0, 50.0, "not reproduced"),
    ],
)
def test_the_fit_to_the_chirp_decides(study, simulation, one_step, verdict):
    assert findings.follows_the_chirp(_okid_fits(study, findings.CHIRP, simulation, one_step)).verdict == verdict


@pytest.mark.parametrize(("p", "verdict"), [(1e-5, "reproduced"), (0.3, "not reproduced")])
def test_an_observer_with_white_residuals_may_be_the_kalman_filter(study, p, verdict):
    changed = with_model_of_joints(study, "okid", whiteness(p))
    assert findings.not_the_kalman_filter(changed).verdict == verdict


def _by_order(study, fits):
    """The study whose observers fit so well by number of states, in simulation and one step ahead."""
    observers = {}
    for joint, analysis in study.observers.items():
        shares = tuple(
            replace(share, simulation=fits[share.order - 1], one_step=fits[share.order - 1])
            for share in analysis.shares
        )
        observers[joint] = replace(analysis, shares=shares)
    return replace(study, observers=observers)


@pytest.mark.parametrize(
    ("fits", "higher", "second"),
    [
        ((60.0, 90.0, 90.5, 90.4, 90.5), "reproduced", "reproduced"),
        ((60.0, 90.0, 90.1, 90.0, 89.0), "not reproduced", "reproduced"),
        ((60.0, 90.0, 95.0, 95.0, 95.0), "reproduced", "partly"),
        ((90.0, 90.0, 90.0, 90.0, 90.0), "not reproduced", "partly"),
        ((94.5, 90.0, 95.0, 95.0, 95.0), "reproduced", "not reproduced"),
    ],
)
def test_fits_by_order_decide_how_many_states_suffice(study, fits, higher, second):
    changed = _by_order(study, fits)
    assert findings.higher_orders_fit_better(changed).verdict == higher
    assert findings.second_order_suffices(changed).verdict == second

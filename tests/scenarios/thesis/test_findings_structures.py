"""F40 to F49: verdicts on prediction-error structures, on studies of which the claim is true and of which it is not."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS
from scenarios.files.errors import MissingRecordError
from scenarios.thesis import findings_structures as findings
from scenarios.thesis.estimates import Fits
from scenarios.thesis.nonparametric import SINES
from scenarios.thesis.robustness import DETRENDED
from scenarios.thesis.simulated_outputs import simulated
from tests.scenarios.thesis.altered import estimated, gained, whiteness, with_joints, with_model_of_joints

YAW, SHOULDER, ELBOW = STUDIED_JOINTS


def with_sets(study, change):
    """The study with models from every data set that `change` makes from each of them."""
    sets = {}
    for joint, data_sets in study.data_sets.items():
        models = tuple(replace(model, **change(model)) for model in data_sets.models)
        sets[joint] = replace(data_sets, models=models)
    return replace(study, data_sets=sets)


@pytest.mark.parametrize(
    ("dismissed", "armax", "verdict"),
    [(1e-4, 0.4, "reproduced"), (1e-4, 1e-4, "partly"), (0.4, 1e-4, "not reproduced")],
)
def test_whiteness_decides_which_structure_characterizes_the_noise(study, dismissed, armax, verdict):
    changed = with_sets(study, lambda model: whiteness({"armax": armax}.get(model.method, dismissed))(model))
    assert findings.noise_characterized(changed).verdict == verdict


def _following(study, percent):
    """The study whose models follow every record by so much, by method."""

    def change(model):
        fit = percent.get(model.method)
        return {} if fit is None else {"fits": {name: Fits(fit, fit) for name in model.fits}, "radius": 0.9}

    return with_sets(study, change)


@pytest.mark.parametrize(
    ("percent", "verdict"),
    [
        ({"armax": 95.0, "oe": 94.0, "arx": 80.0, "iv4": 81.0}, "reproduced"),
        ({"armax": 95.0, "oe": 80.0, "arx": 85.0, "iv4": 81.0}, "partly"),
        ({"armax": 80.0, "oe": 80.0, "arx": 80.1, "iv4": 95.0}, "not reproduced"),
    ],
)
def test_better_structures_are_ahead_of_both_others(study, percent, verdict):
    assert findings.better_structures(_following(study, percent)).verdict == verdict


def _distorted(study, percent):
    return with_joints(
        study,
        lambda result: {"best_linear": replace(result.best_linear, distortion_percent=percent[result.joint])},
    )


def _states(study, needed):
    """The study in which output error needs so many states by joint."""
    orders = []
    for entry in study.robustness.orders:
        if (entry.method, entry.record) == ("SysID", DETRENDED):
            fits = {n: 99.0 if n >= needed[entry.joint] else 50.0 for n in entry.fits}
            entry = replace(entry, fits=fits)
        orders.append(entry)
    return replace(study, robustness=replace(study.robustness, orders=tuple(orders)))


@pytest.mark.parametrize(
    ("yaw_percent", "yaw_states", "verdict"),
    [(18.0, 3, "reproduced"), (18.0, 2, "not reproduced"), (1.0, 3, "partly"), (1.0, 1, "not reproduced")],
)
def test_distortion_of_yaw_is_construction_and_its_order_is_tested(study, yaw_percent, yaw_states, verdict):
    percent = {YAW: yaw_percent, SHOULDER: 3.0, ELBOW: 5.0}
    decided = findings.yaw_most_nonlinear(_states(_distorted(study, percent), {YAW: yaw_states, SHOULDER: 2, ELBOW: 2}))
    assert decided.verdict == verdict
    assert ("By construction, and not counted: most nonlinear" in decided.why) == (yaw_percent == 18.0)


def test_without_orders_nothing_is_said_of_the_yaw(study):
    bare = replace(study, robustness=replace(study.robustness, orders=()))
    with pytest.raises(MissingRecordError, match="shoulder yaw"):
        findings.yaw_most_nonlinear(bare)


@pytest.mark.parametrize(
    ("own", "others", "verdict"), [(60.0, 95.0, "reproduced"), (90.0, 95.0, "partly"), (90.0, 80.0, "not reproduced")]
)
def test_yaw_armax_is_judged_on_its_own_record_and_on_others(study, own, others, verdict):
    changed = _following(study, {"armax": others, "oe": 90.0, "arx": 70.0, "iv4": 70.0})

    def own_record(model):
        return {"fits": {**model.fits, model.record: Fits(own, own)}} if model.method == "armax" else {}

    assert findings.yaw_armax_best(with_sets(changed, own_record)).verdict == verdict


@pytest.mark.parametrize(
    ("with_pair", "without", "verdict"),
    [
        (95.0, 90.0, "reproduced"),
        (95.0, -np.inf, "reproduced"),
        (95.0, 94.9, "not reproduced"),
        (-np.inf, -np.inf, "not reproduced"),
    ],
)
def test_the_pair_counts_by_the_fit_that_it_gains(study, monkeypatch, with_pair, without, verdict):
    poles = {5: with_pair, 4: without}

    def fit(model, records):
        return poles[len(model.polynomials.A) - 1]

    monkeypatch.setattr(findings, "simulation_fit", fit)
    assert findings.yaw_without_the_pair(study).verdict == verdict


@pytest.mark.parametrize(("p", "verdict"), [(0.2, "reproduced"), (1e-6, "not reproduced")])
def test_independence_of_the_yaw_oe_is_a_test_at_1_percent(study, p, verdict):
    def change(model):
        return {"residual_test": replace(model.residual_test, independence_p=np.array([[p]]))}

    assert findings.yaw_oe_independent(with_model_of_joints(study, "oe", change)).verdict == verdict


def _measured(study, test, times, shift=0):
    """The study in which the yaw moves so many times as far as its OE model says, and some samples later."""

    def data(result):
        record = result.data[test]
        y = np.roll(times * simulated(result.models["oe"].estimate.model, record), shift)
        return {"data": {**result.data, test: replace(record, y=y[:, None])}}

    return with_joints(study, data, (YAW,))


@pytest.mark.parametrize(
    ("times", "oe", "verdict"),
    [(2.0, 95.0, "reproduced"), (1.0, 95.0, "partly"), (2.0, 50.0, "partly"), (1.0, 50.0, "not reproduced")],
)
def test_peaks_and_fit_of_the_prbs_record_decide(study, times, oe, verdict):
    changed = _measured(study, 5, times)
    for method, fit in (("oe", oe), ("armax", 90.0)):
        changed = with_model_of_joints(
            changed, method, lambda model, fit=fit: {"fits": {**model.fits, 5: Fits(fit, fit)}}, (YAW,)
        )
    decided = findings.yaw_oe_follows_the_mean(changed)
    assert decided.verdict == verdict
    assert decided.value["share of the peaks"] == pytest.approx(1 / times, rel=0.02)


@pytest.mark.parametrize(
    ("times", "shift", "gain", "verdict"),
    [(2.0, 0, 1.0, "reproduced"), (1.0, 0, 1.0, "partly"), (2.0, 4, 1.0, "partly"), (0.1, 4, 20.0, "not reproduced")],
)
def test_crossings_peaks_and_gain_of_the_yaw_oe_decide(study, times, shift, gain, verdict):
    """The angle is laid beside a model whose gain is another than that it was made with."""
    changed = _measured(study, SINES, times, shift)
    changed = with_model_of_joints(
        changed, "oe", lambda model: {"estimate": estimated(gained(model.estimate.model, gain))}, (YAW,)
    )
    decided = findings.yaw_oe_at_10_hz(changed)
    assert decided.verdict == verdict
    assert decided.parts["right at crossings"] == (shift == 0)


@pytest.mark.parametrize(("factor", "verdict"), [(1.2, "reproduced by construction"), (1.5, "not reproduced")])
def test_structures_within_3_db_agree(study, factor, verdict):
    armax = {joint: study.joints[joint].models["armax"].estimate.model for joint in STUDIED_JOINTS}

    def change(model):
        joint = next(name for name in STUDIED_JOINTS if model.record.endswith(name))
        times = 1.0 if model.method == "armax" else factor
        return {"estimate": estimated(gained(armax[joint], times))}

    singles = replace(
        study,
        data_sets={joint: replace(sets, models=sets.singles()) for joint, sets in study.data_sets.items()},
    )
    decided = findings.structures_agree(with_sets(singles, change))
    assert decided.verdict == verdict
    assert decided.value[f"{YAW}, OE, dB"] == pytest.approx(20 * np.log10(factor))


@pytest.mark.parametrize(
    ("yaw", "others", "verdict"), [(8.0, 3.0, "reproduced"), (18.0, 3.0, "partly"), (18.0, 30.0, "not reproduced")]
)
def test_a_tenth_of_distortion_is_linear_enough(study, yaw, others, verdict):
    assert findings.linear_enough(_distorted(study, {YAW: yaw, SHOULDER: others, ELBOW: others})).verdict == verdict

"""Models from spoilt records: counted, compared, and never dropped."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.thesis.model_charts import disturbed
from scenarios.thesis.robustness import (
    CONSTANT,
    DETRENDED,
    JUDGES,
    OUTLIERS,
    WITH_MEANS,
    OrderNeeded,
    Robustness,
    RobustnessOutcome,
    comparable,
    other_structures,
    robustness,
    sysid_method,
    tolerance,
)


def outcome(degree, *, hz=1.0, fit=99.0):
    return RobustnessOutcome(
        joint="elbow_pitch",
        method="oe",
        chosen=True,
        disturbance="bias",
        treatment="nothing removed",
        degree=degree,
        bandwidth_hz=hz,
        error=100 * (hz - 1),
        covers=not np.isnan(hz),
        fit=fit,
    )


def test_every_disturbance_gives_every_draw_of_every_method(study, fewer_disturbances):
    for joint in study.joints:
        for key, disturbance in fewer_disturbances.items():
            # Of a record of 20 s there are parts of 10 s and none that are longer.
            degrees = (10.0,) if key == "length" else disturbance.degrees
            expected = dict.fromkeys(degrees, 1)
            for method in (sysid_method(joint), "okid"):
                for treatment in disturbance.treatments:
                    draws = study.robustness.of(key, joint, method, treatment)
                    assert {degree: len(entries) for degree, entries in draws.items()} == expected
        others = {entry.method for entry in other_structures(joint)}
        for key, expected in (("outliers", others), ("drift", set())):
            tried = {one.method for one in study.robustness.outcomes if (one.joint, one.disturbance) == (joint, key)}
            assert tried == {sysid_method(joint), "okid"} | expected


def test_the_record_as_it_is_gives_the_model_without_harm(study):
    for joint, entry in study.joints.items():
        for method in (sysid_method(joint), "okid"):
            reference = study.robustness.of("bias", joint, method)[0.0][0]
            assert reference.bandwidth_hz == pytest.approx(entry.models[method].bandwidth_hz, rel=1e-6)
            detrended = study.robustness.of("bias", joint, method, "mean removed")[2.0][0]
            assert detrended.bandwidth_hz == pytest.approx(reference.bandwidth_hz, rel=1e-3)


def test_what_judges_is_another_record_than_what_models_come_from(study):
    for joint, entry in study.joints.items():
        assert study.robustness.judged_by[joint] == JUDGES
        own, twin = entry.data[study.estimation_test].u[:, 0], entry.data[6].u[:, 0]
        for number in JUDGES:
            assert abs(np.corrcoef(own, entry.data[number].u[:, 0])[0, 1]) < 0.5
        # The PRBS of twice the amplitude is much the same command: it would judge nothing.
        assert np.corrcoef(own, twin)[0, 1] > 0.8


def test_a_finding_rests_on_orders_that_do_not_depend_on_what_else_is_tried(study):
    only = robustness(study.campaign, thorough=False)
    assert only.outcomes == ()
    assert only.orders == study.robustness.orders
    assert {entry.record for entry in only.orders} == {DETRENDED, WITH_MEANS, CONSTANT, OUTLIERS}


def test_errors_are_of_the_bandwidths_that_there_are():
    entries = (outcome(0.0), outcome(0.5), outcome(0.5, hz=np.nan), outcome(0.5, hz=1.2))
    shifts = Robustness(entries, (), {"elbow_pitch": (2, 7, 8)})
    assert shifts.curve("bias", "elbow_pitch", "oe")[0.5][0] == pytest.approx((10.0, 0.0, 20.0))


def test_comparable_is_within_ten_percent_and_five_points():
    reference = outcome(0.0)
    assert comparable((outcome(0.5, hz=1.09, fit=94.5),), reference)
    assert not comparable((outcome(0.5, hz=1.11),), reference)
    assert not comparable((outcome(0.5, fit=93.5),), reference)
    assert not comparable((outcome(0.5, hz=np.nan),), reference)
    assert not comparable((outcome(0.5), outcome(0.5), outcome(0.5, hz=np.nan, fit=np.nan)), reference)


def test_tolerance_ends_at_the_first_degree_that_is_too_much():
    degrees = {0.0: 1.0, 0.1: 1.05, 0.5: 1.5, 2.0: 1.0}
    shifts = Robustness(tuple(outcome(d, hz=hz) for d, hz in degrees.items()), (), {"elbow_pitch": (2, 7, 8)})
    assert tolerance(shifts, "bias", "elbow_pitch", "oe") == "up to 0.1"
    assert tolerance(shifts, "drift", "elbow_pitch", "oe") == "–"
    calm = Robustness(tuple(outcome(d) for d in degrees), (), shifts.judged_by)
    assert tolerance(calm, "bias", "elbow_pitch", "oe") == "all, up to 2"
    wild = Robustness((outcome(0.0), outcome(0.1, hz=2.0)), (), shifts.judged_by)
    assert tolerance(wild, "bias", "elbow_pitch", "oe") == "none"


@pytest.mark.parametrize(
    ("fits", "needed"), [({1: 80.0, 2: 98.2, 3: 99.0}, 2), ({1: 80.0, 2: 97.9, 3: 99.0}, 3), ({1: -np.inf, 2: 60.0}, 2)]
)
def test_the_order_that_suffices_is_the_smallest_near_the_best(fits, needed):
    assert OrderNeeded("elbow_pitch", "OKID", CONSTANT, fits).needed == needed


def test_an_order_suffices_near_the_best_of_another_record_or_none_does():
    orders = OrderNeeded("elbow_pitch", "OKID", CONSTANT, {1: 80.0, 2: 93.0, 3: 96.0})
    assert [orders.sufficient(best, 5.0) for best in (97.0, 99.0, 102.0)] == [2, 3, 4]


def test_the_figure_of_a_record_too_short_for_most_parts_has_what_is_known():
    one = replace(outcome(10.0), disturbance="length")
    shifts = Robustness((outcome(0.0), one, replace(one, method="okid")), (), {"elbow_pitch": (2, 7, 8)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        error, rest = disturbed(SimpleNamespace(robustness=shifts)).views["length",]
    assert [(series.label, series.x) for series in error.series] == [("OKID", [10.0])]
    assert rest.series[0].y.tolist() == [100.0 - one.fit]

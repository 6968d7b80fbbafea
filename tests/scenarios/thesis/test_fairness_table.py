"""The same table for every arm."""

from dataclasses import replace

import pytest

from hmtb_twin import STUDIED_JOINTS, linearize
from scenarios.experiments.campaign import NOMINAL, Condition
from scenarios.identification.methods import estimate
from scenarios.thesis import fairness_table
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.estimates import Fits
from scenarios.thesis.fairness_section import conclusions, percent
from scenarios.thesis.fairness_table import ArmFairness, FairModel, chosen
from sysid import SysidError

METHODS = ["arx", "armax", "iv4", "oe", "okid", "oe_high"]


def test_every_arm_has_every_model_and_its_own_truth(study):
    assert [arm.condition for arm in study.fairness] == [entry.condition for entry in study.campaigns]
    first = study.fairness[0]
    for joint, models in first.joints.items():
        assert [entry.method for entry in models if not entry.printed] == METHODS
        assert [entry.bandwidth_hz for entry in models if entry.printed] == [
            entry.bandwidth_hz for entry in study.joints[joint].published
        ]
        assert first.truth_hz[joint] == study.joints[joint].truth.bandwidth_hz


def test_models_of_the_main_arm_are_those_of_the_study(study):
    for joint, entry in study.joints.items():
        for model in study.fairness[0].joints[joint]:
            if not model.printed and model.method in entry.models:
                known = entry.models[model.method]
                assert model.bandwidth_hz == pytest.approx(known.bandwidth_hz)
                assert {n: fit.simulation for n, fit in model.fits.items()} == pytest.approx(
                    {n: fit.simulation for n, fit in known.fits.items()}
                )


def test_without_a_noise_model_a_prediction_is_a_simulation(study):
    for models in study.fairness[0].joints.values():
        for entry in models:
            if entry.method in ("oe", "oe_high"):
                assert not entry.model.gain.any()
                assert all(fit.simulation == pytest.approx(fit.one_step) for fit in entry.fits.values())
            elif not entry.printed:
                assert entry.model.gain.any()


def test_the_hybrid_has_the_yaw_of_sysid_and_the_pitches_of_okid(study):
    arm = study.fairness[0]
    yaw, *pitches = STUDIED_JOINTS
    assert set(arm.three_joint["hybrid", False]) == set(fairness_table.RECORDS)
    for record, fits in arm.three_joint["hybrid", False].items():
        assert fits[yaw] == arm.fits("SysID", False, record)[yaw]
        assert all(fits[joint] == arm.fits("OKID", False, record)[joint] for joint in pitches)


def test_estimation_and_validation_are_apart():
    fits = {n: Fits(float(n), float(n)) for n in (1, 2, 3, 5, 6)}
    model = FairModel("oe", "OE", True, False, None, 1.0, None, False, fits)
    assert model.validation == Fits(2.0, 2.0), "test 6 plays the sequence of test 5"
    assert replace(model, fits={5: fits[5], 6: fits[6]}).validation is None


def arm(condition, okid):
    def model(method, fit):
        return FairModel(method, method, True, False, None, 1.0, (0.9, 1.1), True, {1: Fits(fit, fit)})

    joints = {joint: (model("armax", 90.0), model("okid", okid)) for joint in STUDIED_JOINTS}
    several = {
        (name, False): {"rpcm": {joint: Fits(fit, fit) for joint in STUDIED_JOINTS}}
        for name, fit in (("SysID", 90.0), ("OKID", okid))
    }
    return ArmFairness(condition, dict.fromkeys(STUDIED_JOINTS, 1.0), joints, several)


@pytest.mark.slow
def test_a_refused_model_leaves_out_what_it_is_part_of(synthetic_logs, monkeypatch):
    def refuses(data, estimator, orders):
        if estimator == "okid" and "yaw" in data.name:
            raise SysidError("too little past")
        # ARX has the same path from input to output, and takes no search
        return (
            estimate(data, "arx", (*orders[:2], orders[-1]))
            if estimator == "armax"
            else estimate(data, estimator, orders)
        )

    monkeypatch.setattr("scenarios.thesis.estimates.estimate", refuses)
    logs = synthetic_logs([f"siso-{number}-{joint}" for number in (2, 5) for joint in STUDIED_JOINTS] + ["mimo-10"])
    (first,) = fairness_table.fairness((Campaign(NOMINAL, linearize(NOMINAL.arm()), logs, {}),))
    yaw = chosen(first.joints["shoulder_yaw"], okid=True)
    assert (yaw.model, yaw.refused, yaw.validation) == (None, "too little past", None)
    others = [("SysID", False), ("hybrid", False), ("SysID", True), ("OKID", True), ("hybrid", True)]
    assert list(first.three_joint) == others, "the hybrid has OKID's pitches alone"
    by_name = {entry.question: entry.answers[NOMINAL] for entry in conclusions((first,))}
    for question in (
        "SysID or OKID better on the slow chirp, 0 to 1 Hz, in simulation",
        "SysID or OKID better on single-joint tests not seen, in simulation",
    ):
        assert by_name[question] is None


def test_conclusions_that_change_are_told_from_those_that_stay():
    arms = (arm(Condition(), 91.0), arm(Condition(friction=False), 89.0), arm(Condition("published"), 91.1))
    by_name = {entry.question: entry for entry in conclusions(arms)}
    unseen = by_name["SysID or OKID better on single-joint tests not seen, in simulation"]
    assert [answer.words for answer in unseen.answers.values() if answer] == [
        "OKID: yaw, shoulder, elbow",
        "SysID: yaw, shoulder, elbow",
        "OKID: yaw, shoulder, elbow",
    ]
    assert unseen.changes == {"friction", "both"}
    assert set(by_name["SysID or OKID better on the slow chirp, 0 to 1 Hz, in simulation"].answers.values()) == {None}
    assert not any(entry.changes for entry in conclusions(arms[:1]))


def test_fits_without_bound_are_printed_as_such():
    assert percent(98.123) == "98.1"
    assert percent(float("-inf")) == percent(-3e150) == "< −1000"

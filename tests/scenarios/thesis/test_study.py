"""The whole pipeline on short records, against the truth."""

import re
from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, linearize, load_arm
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.parameters.variants import MOTIONS
from scenarios.experiments.campaign import NOMINAL, RPCM, SINGLE_JOINT, Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import SETTLING, prepared, swing, velocity_limited_share
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.registry import load
from scenarios.identification.recovered_bandwidth import intervals_agree
from scenarios.record_figures.period_spectra import period_spectra
from scenarios.thesis.attribution import CONDITIONS as SWITCHED_OFF
from scenarios.thesis.attribution import ORDERS, order_effects, scaled
from scenarios.thesis.campaign import CONDITIONS, EVERY_TEST, FAIRNESS_TESTS, OTHER_WAVEFORMS, Campaign
from scenarios.thesis.estimates import fits
from scenarios.thesis.multivariable import FULL_OKID, INDEPENDENT, METHODS, full_models, three_joint_truth
from scenarios.thesis.study import ESTIMATION_TEST, JUDGING, draw_conclusions, plan, run_study, study_joint
from sysid import IOData, SysidError
from sysid.models.bandwidth import half_power_hz
from tests.refusals import refused


def test_every_joint_has_every_method_and_every_fit(study):
    assert tuple(study.joints) == STUDIED_JOINTS
    assert not study.failed
    for entry in study.joints.values():
        assert set(entry.models) == {"armax", "oe", "okid", "oe_high"}
        assert set(entry.data) == set(SINGLE_JOINT)
        for model in entry.models.values():
            assert set(model.fits) == set(SINGLE_JOINT)


def test_structures_are_the_thesis_own():
    chosen = {
        joint: {entry.estimator: entry.orders for entry in entries if entry.chosen}
        for joint, entries in STRUCTURES.items()
    }
    assert chosen == {
        "shoulder_yaw": {"armax": (5, 3, 3, 2), "okid": (2, 5)},
        "shoulder_pitch": {"oe": (2, 2, 1), "okid": (2, 5)},
        "elbow_pitch": {"armax": (2, 2, 2, 2), "okid": (2, 5)},
    }


def test_friction_slows_every_model_and_a_sufficient_order_finds_the_best_linear_truth(study):
    for entry in study.joints.values():
        best, small = entry.best_linear, half_power_hz(entry.truth.model)
        assert best.half_power_hz < small
        for model in entry.models.values():
            assert not model.half_power_hz >= small
            assert model.ci95[0] < model.bandwidth_hz < model.ci95[1]
            assert model.covers == intervals_agree((model.bandwidth_hz, *model.ci95), (best.hz, *best.ci95))
        # A multisine as strong as the PRBS meets other friction than the PRBS itself.
        assert entry.models["oe_high"].half_power_hz == pytest.approx(best.half_power_hz, rel=0.35)


def test_without_friction_the_truth_comes_back(study):
    for name, entry in study.attribution.items():
        assert not entry.missing
        rough, *smooth = entry.parts
        true, level = study.joints[name].truth.bandwidth_hz, half_power_hz(study.joints[name].truth.model)
        assert tuple(part.label for part in entry.parts) == SWITCHED_OFF
        for part in smooth:
            assert part.half_power_hz == pytest.approx(level, rel=0.03)
            assert part.ci95[0] <= true <= part.ci95[1] or part.bandwidth_hz == pytest.approx(true, rel=0.01)
            assert abs(rough.half_power_hz - level) > abs(part.half_power_hz - level)


def test_a_sufficient_order_follows_data_that_it_has_not_seen_better_than_the_frictionless_truth(study):
    for entry in study.joints.values():
        judges = [entry.data[number] for number in OTHER_WAVEFORMS]
        follows = np.median([entry.models["oe_high"].fits[number].simulation for number in OTHER_WAVEFORMS])
        assert follows > np.median([fits(entry.truth.model, record).simulation for record in judges])


def test_three_joint_models_are_nearer_to_the_true_coupled_response_than_the_printed_ones(study):
    own, printed = study.multivariable.models[:3], study.multivariable.models[3:]
    assert [entry.model.order for entry in own] == [10, 6, 9]
    for entry in own:
        assert entry.diagonal_error < entry.error < min(one.error for one in printed)


def test_same_seed_same_result(study):
    name = single_joint_test(ESTIMATION_TEST, "elbow_pitch")
    again, other = (campaign_scenario(name, seed=seed, duration=24.0) for seed in (11, 12))
    assert study.logs[name].seed == again.seed != other.seed
    assert again.excitation[0].parameters["seed"] == 11


def test_conditions_switch_off_one_thing_more_each_time():
    scenario = load("siso-5-elbow_pitch")
    smooth = Condition(friction=False).applied(scenario)
    small = scaled(smooth)
    assert (smooth.chain.friction, small.chain.friction) == (False, False)
    np.testing.assert_array_equal(smooth.volts(), scenario.volts())
    asked, less = (replace(entry, chain=replace(entry.chain, dac=False)).volts() for entry in (scenario, small))
    np.testing.assert_allclose(less, 0.3 * asked)
    assert {entry.chain.noise and entry.chain.resolver for entry in (smooth, small)} == {True}
    assert (smooth.seed, small.seed, small.name) == (scenario.seed, scenario.seed, f"{scenario.name}-small")


def test_preparation_leaves_whole_settled_periods_without_mean(study):
    log = study.logs["siso-5-elbow_pitch"]
    data = prepared(log, "elbow_pitch")
    assert len(data) == len(log.commanded) - round(50 * SETTLING)
    assert len(data) % 200 == 0
    assert abs(data.u.mean()) < 1e-15
    assert abs(data.y.mean()) < 1e-15


def test_slewing_counts_steps_at_the_velocity_limit(study):
    for name, entry in study.joints.items():
        assert set(entry.slewing) == set(SINGLE_JOINT)
        assert entry.slewing[ESTIMATION_TEST] < entry.slewing[6] < 1.0, "test 6 plays twice the amplitude"
        log = study.logs[f"siso-{ESTIMATION_TEST}-{name}"]
        pose = load_arm().pose("rpcm_holster_out_approach")[JOINTS.index(name)]
        asked = pose + HAND_CONTROLLER.gain * (HAND_CONTROLLER.adc_step * log.counts[:, 0])
        before = np.concatenate([[pose], log.commanded[:-1, JOINTS.index(name)]])
        limited = np.abs(asked - before) > MOTIONS[name].velocity_limit * log.dt
        assert velocity_limited_share(log) == pytest.approx(limited.mean(), abs=1e-12)
        slow = replace(log, commanded=log.commanded[0] + 0.5 * (log.commanded - log.commanded[0]))
        assert swing(slow, name) == pytest.approx(0.5 * entry.swing[ESTIMATION_TEST])


def test_orders_disagree_on_the_gain_at_0_hz_but_hardly_on_where_it_is_0707(study):
    """Nothing excites 0 Hz."""
    for name, effects in study.orders.items():
        assert tuple(entry.orders[:2] for entry in effects) == ORDERS
        assert study.joints[name].models["oe_high"].bandwidth_hz in [entry.bandwidth_hz for entry in effects]
        # a pole at the unit circle, where the search stops, fits the noise of so short a record
        enough = [entry for entry in effects if entry.orders[:2] != (2, 2) and entry.radius < 1.0 - 1e-5]
        assert len(enough) >= 6
        bands, levels = [entry.bandwidth_hz for entry in enough], [entry.half_power_hz for entry in enough]
        assert max(levels) / min(levels) < min(max(bands) / min(bands), 1.03)


def test_period_spectra_tell_the_disturbance_apart():
    rng = np.random.default_rng(3)
    u = np.tile(rng.standard_normal(100), 200)
    noise = 0.1 * rng.standard_normal(len(u))
    spectra = period_spectra(IOData(u, 2.0 * u + noise, 0.02))
    np.testing.assert_allclose(spectra.output, 4.0 * spectra.input, rtol=0.1)
    # White noise of variance 0.01 has the two-sided density 0.01 dt at every frequency.
    assert spectra.disturbance.mean() == pytest.approx(0.01 * 0.02, rel=0.05)


SMOOTH = Condition(friction=False)
PUBLISHED = Condition("published")


@pytest.mark.parametrize("given", [(NOMINAL,), (NOMINAL, PUBLISHED, SMOOTH), CONDITIONS])
def test_the_second_campaign_is_always_the_same_arm_without_friction(given):
    played = plan(given)
    arms = [condition for condition, _ in played]
    assert arms[:2] == [NOMINAL, SMOOTH]
    assert set(arms) == {*given, SMOOTH}
    assert len(set(arms)) == len(arms)
    estimation = {single_joint_test(ESTIMATION_TEST, joint) for joint in STUDIED_JOINTS}
    small = {f"{name}-small" for name in estimation}
    for condition, scenarios in played:
        lengths = {scenario.name: scenario.duration for scenario in scenarios}
        assert len(lengths) == len(scenarios)
        assert estimation <= set(lengths)
        if condition in given[1:]:
            assert set(lengths) - small == set(FAIRNESS_TESTS)
        if condition != NOMINAL:
            # Models are identified from whole records; those that only judge repeat themselves.
            assert {name for name, length in lengths.items() if length == 240.0} - small == estimation
            assert set(lengths.values()) <= {240.0, JUDGING, load(RPCM).duration}
        assert (small <= set(lengths)) == (condition == SMOOTH)
    assert tuple(scenario.name for scenario in played[0][1]) == EVERY_TEST
    assert {scenario.duration for scenario in played[0][1]} == {240.0, load(RPCM).duration}


def test_short_records_are_no_longer_on_other_arms():
    lengths = {scenario.duration for _, scenarios in plan(CONDITIONS, duration=24.0) for scenario in scenarios}
    assert lengths == {24.0, load(RPCM).duration}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"conditions": ()}, "no arms given"),
        ({"conditions": (NOMINAL, PUBLISHED, NOMINAL)}, "more than once: nominal, with friction"),
        ({"conditions": (SMOOTH,)}, "cannot be about the arm nominal, without friction"),
        ({"duration": 8.0}, "needs records of 20 s or more"),
        ({"duration": float("nan")}, "needs records of 20 s or more"),
        ({"seed": 1.5}, "seed must be a whole number, given 1.5"),
    ],
)
def test_what_no_study_can_be_made_of_is_refused_before_anything_is_played(settings, message, monkeypatch):
    def never(*_, **__):
        pytest.fail("something was played")

    monkeypatch.setattr("scenarios.thesis.study.run_campaign", never)
    refused(message, run_study, **settings)


def test_conclusions_are_drawn_of_an_arm_and_the_same_without_friction():
    truth = linearize(NOMINAL.arm())
    rough, smooth, other = (Campaign(arm, truth, {}, {}) for arm in (NOMINAL, SMOOTH, PUBLISHED))
    for values in ((), (rough,), (rough, other), (smooth, rough), (smooth, smooth)):
        refused("expected campaigns of an arm with friction", draw_conclusions, values)


@pytest.mark.slow
def test_a_record_without_a_model_that_the_study_is_about_is_named(synthetic_logs, monkeypatch):
    name = single_joint_test(ESTIMATION_TEST, "elbow_pitch")

    def refuses(*_):
        raise SysidError("the regressors are dependent")

    monkeypatch.setattr("scenarios.thesis.estimates.estimate", refuses)
    campaign = Campaign(NOMINAL, linearize(NOMINAL.arm()), synthetic_logs([name]), {})
    label = STRUCTURES["elbow_pitch"][0].label
    refused(re.escape(f"{name} gives no model {label}"), study_joint, "elbow_pitch", campaign)


def test_an_order_that_is_refused_is_left_out(synthetic_logs, monkeypatch):
    name = single_joint_test(ESTIMATION_TEST, "elbow_pitch")
    data = prepared(synthetic_logs([name])[name], "elbow_pitch")
    oe = sysid.oe

    def refuses(data, nb, nf, nk, **options):
        if nf > 2:
            raise SysidError("no minimum")
        return oe(data, nb, nf, nk, **options)

    monkeypatch.setattr(sysid, "oe", refuses)
    assert [effect.orders for effect in order_effects(data, 1)] == [(2, 2, 1)]
    monkeypatch.setattr("scenarios.thesis.attribution.ORDERS", ((3, 3),))
    refused(f"{name} gives no output-error model of any order: 3, 3, 1: no minimum", order_effects, data, 1)


@pytest.mark.slow
def test_a_method_that_refuses_a_record_of_several_joints_is_left_out(synthetic_logs, monkeypatch):
    def refuses(_):
        raise SysidError("no states")

    monkeypatch.setitem(METHODS, FULL_OKID, refuses)
    truth = linearize(NOMINAL.arm())
    campaign = Campaign(NOMINAL, truth, synthetic_logs([INDEPENDENT]), {})
    models = full_models(INDEPENDENT, campaign, three_joint_truth(truth))
    assert [entry.method for entry in models] == [name for name in METHODS if name != FULL_OKID]

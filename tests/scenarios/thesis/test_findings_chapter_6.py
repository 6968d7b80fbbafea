"""Findings of chapter VI follow from roots, responses, fits and residuals."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.files.errors import MissingRecordError
from scenarios.thesis import findings_chapter_6 as findings
from scenarios.thesis import verdicts
from scenarios.thesis.findings import FINDINGS
from scenarios.thesis.multivariable import JointFits
from scenarios.thesis.verdicts import outside_share
from sysid import IOData, StateSpace
from sysid.models import block_diagonal
from tests.scenarios.thesis.altered import with_model, with_models, without_log

YAW, SHOULDER, ELBOW = STUDIED_JOINTS


def test_the_printed_models_have_the_roots_that_the_thesis_tells(study):
    printed = [entry for entry in study.multivariable.models if entry.printed]
    ours = [replace(entry, name=entry.name.removeprefix("printed "), printed=False) for entry in printed]
    assert findings.real_poles(with_models(study, [*printed, *ours])).verdict == "reproduced"


def test_roots_are_counted(study):
    assert findings.complex_roots(np.array([1.0, 0.5 + 0.1j, 0.5 - 0.1j, 0.3 + 1e-9j])) == 2
    verdict = findings.real_poles(study).value
    own, okid = study.multivariable.pair()
    assert verdict["SysID complex poles"] == sum(abs(own.model.poles().imag) > 1e-6)
    assert verdict["OKID zeros"] == len(okid.model.zeros())


def test_responses_apart_are_measured_in_gain_and_phase(study):
    own, okid = study.multivariable.pair()
    block = own.blocks["elbow_pitch"]
    half = replace(block, C=0.5 * block.C, D=0.5 * block.D)
    late = StateSpace(
        np.block([[block.A, np.zeros((block.order, 1))], [block.C, np.zeros((1, 1))]]),
        np.vstack((block.B, block.D)),
        np.hstack((np.zeros((1, block.order)), np.ones((1, 1)))),
        np.zeros((1, 1)),
        None,
        block.dt,
    )
    for other, gain, phase in ((half, 20 * np.log10(2.0), 0.0), (late, 0.0, 360 * 5.0 * block.dt)):
        changed = with_model(study, "OKID", blocks={**okid.blocks, "elbow_pitch": other})
        apart = findings.bode_differences(changed.multivariable, "elbow_pitch")
        assert apart == pytest.approx((gain, phase), abs=1e-6)


def test_zeros_at_infinity_are_not_roots(study):
    assert list(findings.finite(np.array([0.5, -66.0, 1.3e4, 0.2 + 1e3j]))) == [0.5, -66.0]


def test_coupling_counts_by_what_others_move(study):
    decided = findings.coupling(study)
    truth = study.multivariable.truth
    gain = np.abs(truth.frequency_response(np.array([5.0]))[0])
    joint = list(study.joints).index("elbow_pitch")
    ratio = decided.value["elbow_pitch, percent of the gain 3 to 5 Hz"]
    assert ratio >= 99.9 * (gain[joint].sum() / gain[joint, joint] - 1)
    # A truth whose every joint answers its own command alone.
    alone = block_diagonal([entry.truth.model for entry in study.joints.values()])
    uncoupled = findings.coupling(replace(study, multivariable=replace(study.multivariable, truth=alone)))
    assert uncoupled.verdict == "reproduced"
    assert all(value == pytest.approx(0.0, abs=1e-9) for value in uncoupled.value.values())
    # One that adds the yaw's command to the answer of every joint.
    mixed = replace(alone, B=alone.B @ np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]]))
    coupled = findings.coupling(replace(study, multivariable=replace(study.multivariable, truth=mixed)))
    assert not coupled.parts["at 3 to 5 Hz on elbow pitch"]
    assert coupled.parts["at 3 to 5 Hz on shoulder yaw"], "nothing else moves the yaw"


def test_the_share_that_others_move_is_that_of_the_simulated_motion(study):
    data = study.campaign.several(RPCM)
    alone = block_diagonal([entry.truth.model for entry in study.joints.values()])
    added = replace(alone, B=alone.B @ np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    models = replace(study.multivariable, truth=added)
    half = sysid.simulate(alone, np.stack((0.5 * data.u[:, 1], 0.0 * data.u[:, 0], 0.0 * data.u[:, 0]), axis=1))[:, 0]
    shares = findings.pushed_share(replace(study, multivariable=models), RPCM)
    assert shares[YAW] == pytest.approx(half.std() / data.y[:, 0].std())
    assert shares[ELBOW] == pytest.approx(0.0, abs=1e-12)


def test_the_largest_ratio_of_gains_is_named_with_its_frequency(study):
    gains = findings._largest_gain_ratio(study)
    truth = study.multivariable.truth
    at = np.abs(truth.frequency_response(np.array([gains["hz"]]))[0])
    row = [name.replace("_", " ") for name in study.joints].index(gains["joint"])
    assert gains["own"] == pytest.approx(at[row, row])
    assert gains["others"] == pytest.approx(at[row].sum() - at[row, row])
    assert gains["ratio"] == pytest.approx(100 * gains["others"] / gains["own"])
    largest = max(value for name, value in findings.coupling(study).value.items() if "of the gain" in name)
    assert gains["ratio"] == pytest.approx(largest, rel=0.02)


def _with_okid(study, change):
    """The study with other fits of the OKID model, made from those of the SysID model."""
    own, _ = study.multivariable.pair()
    return with_model(study, "OKID", fits={name: change(fit) for name, fit in own.fits.items()})


def _moved(simulation, one_step=None):
    """Change all fits in simulation, and those one step ahead by as much or by another number."""
    other = simulation if one_step is None else one_step
    return lambda fits: JointFits(
        {joint: fit + simulation for joint, fit in fits.simulation.items()},
        {joint: fit + other for joint, fit in fits.one_step.items()},
    )


def test_who_is_ahead_on_the_exchange_decides(study):
    worse, better = (findings.exchange_fit(_with_okid(study, _moved(by))) for by in (-2.0, 2.0))
    assert list(worse.value.values()) == pytest.approx([-2.0] * 6)
    assert list(better.value.values()) == pytest.approx([2.0] * 6)
    ahead = {name for name in worse.parts if name.startswith("OKID ")}
    assert len(ahead) == 4
    assert not any(worse.parts[name] for name in ahead)
    assert all(holds for name, holds in better.parts.items() if name.startswith("OKID "))


def test_the_exchange_is_decided_one_step_ahead_and_in_simulation_where_k_is_zero(study):
    for simulation, one_step in ((-2.0, 2.0), (2.0, -2.0)):
        decided = findings.exchange_fit(_with_okid(study, _moved(simulation, one_step)))
        assert decided.parts["OKID predicts better on shoulder yaw"] == (one_step > 0)
        assert decided.parts["OKID simulates better on shoulder pitch"] == (simulation > 0)
        assert decided.value["shoulder_yaw, simulation"] == pytest.approx(simulation)


@pytest.mark.parametrize(("shoulder", "verdict"), [(80.0, "reproduced"), (95.0, "not reproduced")])
def test_what_k_of_zero_makes_of_the_exchange_does_not_count(study, shoulder, verdict):
    """One step ahead OKID is ahead by construction of a shoulder pitch without K: simulation decides there."""
    rest = 90.0
    simulated = dict.fromkeys(STUDIED_JOINTS, rest) | {SHOULDER: shoulder}
    predicted = dict.fromkeys(STUDIED_JOINTS, 98.0 if verdict == "reproduced" else 99.9) | {SHOULDER: shoulder}
    fits = {RPCM: JointFits(simulated, predicted)}
    own, okid = study.multivariable.pair()
    both = with_model(study, "SysID", fits={**own.fits, **fits})
    level = JointFits(dict.fromkeys(STUDIED_JOINTS, rest), dict.fromkeys(STUDIED_JOINTS, 99.0))
    decided = findings.exchange_fit(with_model(both, "OKID", fits={**okid.fits, RPCM: level}))
    assert decided.verdict == verdict
    assert "By construction, and not counted: OKID predicts better on shoulder pitch" in decided.why


@pytest.mark.parametrize(("lead", "verdict"), [(0.5, "reproduced"), (-0.5, "reproduced"), (-5.0, "not reproduced")])
def test_fewer_states_are_judged_by_what_they_cost_where_there_are_fewer(study, monkeypatch, lead, verdict):
    own = {"SysID": 90.0, "OKID": 90.0 + lead}
    # The shoulder pitch, with two states on both sides, would fail: it does not judge.
    monkeypatch.setattr(
        findings,
        "held_out_fit",
        lambda study, kind, joint, way: own[kind] if joint != SHOULDER else {"SysID": 90.0, "OKID": 0.0}[kind],
    )
    decided = findings.parsimony(study)
    assert decided.verdict == verdict
    assert "By construction, and not counted: fewer states" in decided.why
    assert not any("shoulder pitch" in name for name in decided.parts)


def test_slightly_is_neither_less_nor_much_more(study):
    def singles(by):
        joints = {
            joint: replace(
                entry,
                models={
                    **entry.models,
                    "okid": replace(
                        entry.models["okid"],
                        fits={
                            number: replace(fit, simulation=fit.simulation + by, one_step=fit.one_step + by)
                            for number, fit in entry.chosen.fits.items()
                        },
                    ),
                },
            )
            for joint, entry in study.joints.items()
        }
        return replace(_with_okid(study, _moved(by)), joints=joints)

    verdicts = [findings.above_5_hz(singles(by)).verdict for by in (-1.0, 1.0, 30.0)]
    assert verdicts == ["not reproduced", "reproduced", "not reproduced"]


def test_the_hybrid_has_to_be_ahead_of_both(study):
    value = findings.slow_data(study).value
    own, okid = study.multivariable.pair()
    hybrid = study.multivariable.model("hybrid")
    lead = own.fit(findings.SLOW).simulation[YAW] - okid.fit(findings.SLOW).simulation[YAW]
    assert value["yaw, simulation"] == pytest.approx(lead)
    others = max(entry.fit(findings.SLOW).mean("simulation") for entry in (own, okid))
    assert value["hybrid, simulation"] == pytest.approx(hybrid.fit(findings.SLOW).mean("simulation") - others)


def test_a_difference_below_the_margin_is_a_tie(study):
    tied = _with_okid(study, _moved(0.1))
    verdict = findings.exchange_fit(tied)
    assert not any(holds for part, holds in verdict.parts.items() if part.startswith("OKID "))
    assert "tied: shoulder yaw, simulation" in verdict.why.lower()
    slow = findings.slow_data(_with_okid(study, _moved(-0.1)))
    assert "Tied: yaw, simulation" in slow.why
    assert slow.verdict != "reproduced"


def test_following_does_not_rest_on_the_cutoff(study):
    verdict = findings.follows_5_hz(study)
    for way, short in (("in simulation", "simulation"), ("one step ahead", "one step")):
        for joint in study.joints:
            above = verdict.value[f"{joint}, {short}"] > findings.FOLLOWS
            assert verdict.parts[f"{joint.replace('_', ' ')} {way}"] == above


def test_friction_is_judged_only_where_an_exchange_without_it_was_played(study):
    assert RPCM not in study.campaigns[1].logs
    assert "Cause: not tried" in findings.exchange_residuals(study).why
    smooth = replace(study.campaigns[1], logs={**study.campaigns[1].logs, RPCM: study.logs[RPCM]})
    verdict = findings.exchange_residuals(replace(study, campaigns=(study.campaign, smooth))).why
    assert "Cause: models of the arm without friction, on its own exchange, have" in verdict


def _test_of(errors, u):
    """The test of residuals that are known: a model of zero leaves the output itself."""
    model = StateSpace(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), np.zeros((3, 3)), None, 0.02)
    return sysid.resid(model, IOData(u, errors, 0.02))


def test_lags_are_counted_where_they_are():
    rng = np.random.default_rng(3)
    u, e = rng.standard_normal((2, 6000, 3))
    white = outside_share(_test_of(e, u))
    assert max(white.values()) <= 0.2
    coloured = e.copy()
    coloured[:, 1] = np.convolve(e[:, 1], np.ones(20), mode="full")[: len(e)]
    share = outside_share(_test_of(coloured, u))
    assert share[SHOULDER] > 0.5
    assert share[YAW] == white[YAW]
    early, late = e.copy(), e.copy()
    early[:, 0] += np.roll(u[:, 0], 5)
    late[:, 0] += np.roll(u[:, 0], 20)
    first, second = verdicts.dependence(_test_of(early, u))
    assert first == pytest.approx(1 / 14, abs=0.08)
    assert second == pytest.approx(0.0, abs=0.1)
    assert verdicts.dependence(_test_of(late, u))[1] >= 1 / 11


def test_a_coupling_is_found_at_an_input_of_its_own_and_not_at_a_copy():
    rng = np.random.default_rng(4)
    u = rng.standard_normal((6000, 3))
    u[:, 1] = np.convolve(u[:, 0], [0.5, 0.3], mode="same")
    e = rng.standard_normal(6000) + 0.3 * np.roll(u[:, 2], 3)
    _, copy = verdicts.beyond_yaw(u, [1])
    assert copy < 1e-6
    beyond, share = verdicts.beyond_yaw(u, [2])
    assert share > 0.95
    correlation, bound = verdicts.largest_correlation(e, beyond, 0.02)
    assert correlation > bound
    assert correlation == pytest.approx(0.3 / np.sqrt(1.09), abs=0.04)
    chance, bound = verdicts.largest_correlation(rng.standard_normal(6000), beyond, 0.02)
    assert chance < 1.5 * bound


def test_a_shared_waveform_tells_of_no_coupling(study):
    decided = findings.fast_chirp(study)
    data = study.campaign.several("mimo-12")
    told = [verdicts.beyond_yaw(data.u, inputs)[1] >= 0.01 for inputs in ([1], [1, 2])]
    assert sum(part.startswith("slight coupling") for part in decided.parts) == sum(told)


@pytest.mark.parametrize(
    ("extra", "holds"),
    [((0, 2, 0, 2), (True, True, True, True)), ((2, 2, 1, 1), (False, False, True, False))],
)
def test_orders_decide_on_robustness(study, extra, holds):
    """Additional states by SysID and OKID with a bias, then with outliers."""
    kinds = ("with a constant in the output", "with outliers")
    more = dict(zip(product(kinds, findings.KINDS), extra, strict=True))
    orders = tuple(
        replace(
            entry, fits={n: 99.0 if n >= 2 + more.get((entry.record, entry.method), 0) else 0.0 for n in range(1, 5)}
        )
        for entry in study.robustness.orders
    )
    decided = findings.bias_and_outliers(replace(study, robustness=replace(study.robustness, orders=orders)))
    assert tuple(decided.parts.values()) == holds


@pytest.mark.parametrize(
    ("record", "keys"),
    [
        (RPCM, ("F18", "F19", "F26")),
        ("mimo-12", ("F20",)),
        ("mimo-10", ("F21",)),
        ("siso-7-elbow_pitch", ("F5",)),
    ],
)
def test_what_has_no_record_is_not_decided(study, record, keys):
    poor = without_log(study, record, "the arm met the worksite")
    for key in keys:
        with pytest.raises(MissingRecordError, match=f"{record}: the arm met the worksite"):
            FINDINGS[key](poor)


def test_joints_that_cannot_predict_are_named(study):
    own, okid = study.multivariable.pair()
    assert "K = 0 on shoulder pitch" in verdicts.without_noise_model(own)
    assert verdicts.without_noise_model(okid) == "every joint of the OKID model has a noise model"

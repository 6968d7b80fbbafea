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
from scenarios.thesis.reference_fits import COUPLED
from scenarios.thesis.verdicts import outside_share
from sysid import IOData, StateSpace
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


def test_coupling_counts_by_what_it_is_worth_in_the_exchange(study):
    decided = findings.coupling(study)
    alone, whole = (study.multivariable.reference(kind, RPCM) for kind in ("truth without coupling", COUPLED))
    for joint in study.joints:
        assert decided.value[f"{joint}, points in the exchange"] == pytest.approx(whole[joint] - alone[joint])
    truth = study.multivariable.truth
    gain = np.abs(truth.frequency_response(np.array([5.0]))[0])
    joint = list(study.joints).index("elbow_pitch")
    share = decided.value["elbow_pitch, percent of the gain 3 to 5 Hz"]
    assert share >= 99.9 * (gain[joint].sum() / gain[joint, joint] - 1)
    better = {name: fit + 5.0 for name, fit in study.multivariable.reference(COUPLED, RPCM).items()}
    known = study.multivariable.references
    references = {**known, COUPLED: {**known[COUPLED], RPCM: better}}
    worth = replace(study.multivariable, references=references)
    assert findings.coupling(replace(study, multivariable=worth)).verdict == "not reproduced"


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
    ahead = {name for name in better.parts if name.startswith("OKID ahead")}
    assert all(better.parts[name] and not worse.parts[name] for name in ahead)
    assert len(ahead) == 3


def test_the_exchange_is_decided_one_step_ahead(study):
    for simulation, one_step in ((-2.0, 2.0), (2.0, -2.0)):
        decided = findings.exchange_fit(_with_okid(study, _moved(simulation, one_step)))
        assert decided.parts["OKID ahead on shoulder yaw"] == (one_step > 0)
        assert decided.value["shoulder_yaw, simulation"] == pytest.approx(simulation)


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
    assert not any(holds for part, holds in verdict.parts.items() if part.startswith("OKID ahead"))
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

"""Findings on fits follow from the fits."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.files.errors import MissingRecordError
from scenarios.thesis import findings_fits as findings
from scenarios.thesis.findings import FINDINGS
from scenarios.thesis.multivariable import JointFits
from scenarios.thesis.outcome import numbers
from sysid import IOData, StateSpace
from tests.scenarios.thesis.altered import with_model, without_log

YAW, SHOULDER, ELBOW = STUDIED_JOINTS


def _with_okid(study, change):
    """The study with other fits of the OKID model, made from those of the SysID model."""
    own, _ = study.multivariable.pair()
    return with_model(study, "OKID", fits={name: change(fit) for name, fit in own.fits.items()})


def _moved(simulation, one_step=None):
    """Change all fits in simulation, and those one step ahead by as much or by another number."""
    other = simulation if one_step is None else one_step
    return lambda fits: JointFits(
        {joint: value + simulation for joint, value in fits.simulation.items()},
        {joint: value + other for joint, value in fits.one_step.items()},
    )


def test_who_is_ahead_on_the_exchange_decides(study):
    worse, better = (findings.exchange_fit(_with_okid(study, _moved(by))) for by in (-2.0, 2.0))
    assert list(numbers(worse).values()) == pytest.approx([-2.0] * 6)
    assert list(numbers(better).values()) == pytest.approx([2.0] * 6)
    assert worse.verdict in {"not reproduced", "partly"}
    assert better.verdict in {"reproduced", "partly"}
    for text in (worse.why, better.why):
        assert "in simulation" in text
        assert "one step ahead" in text


def test_ahead_one_way_only_is_said(study):
    verdict = findings.exchange_fit(_with_okid(study, _moved(-1.0, 1.0)))
    assert verdict.verdict == "partly"
    assert numbers(verdict)["shoulder_yaw, simulation"] == pytest.approx(-1.0)
    assert numbers(verdict)["shoulder_yaw, one step"] == pytest.approx(1.0)


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
    value = numbers(findings.slow_data(study))
    own, okid = study.multivariable.pair()
    hybrid = study.multivariable.model("hybrid")
    for record in findings.SLOW:
        lead = own.fit(record).simulation[YAW] - okid.fit(record).simulation[YAW]
        assert value[f"yaw, {record}, simulation"] == pytest.approx(lead)
        others = max(entry.fit(record).mean("simulation") for entry in (own, okid))
        assert value[f"hybrid, {record}, simulation"] == pytest.approx(hybrid.fit(record).mean("simulation") - others)


def test_a_difference_below_the_margin_is_a_tie(study):
    tied = _with_okid(study, _moved(0.1))
    verdict = findings.exchange_fit(tied)
    assert "0 of 4 parts hold" in verdict.why or "1 of 4 parts hold" in verdict.why
    assert "tied: shoulder yaw, simulation" in verdict.why
    slow = findings.slow_data(_with_okid(study, _moved(-0.1)))
    assert "tied: yaw, mimo-10, simulation" in slow.why
    assert slow.verdict != "reproduced"


def test_following_does_not_rest_on_the_cutoff(study):
    verdict = findings.follows_5_hz(study)
    ways = [
        sum(value > findings.FOLLOWS for name, value in numbers(verdict).items() if name.endswith(way))
        for way in ("simulation", "one step")
    ]
    assert f"{ways[0]} of 3 parts hold in simulation and {ways[1]} of 3" in verdict.why
    assert "coupling" in verdict.why


def test_friction_is_judged_only_where_an_exchange_without_it_was_played(study):
    assert RPCM not in study.campaigns[1].logs
    assert "without friction" not in findings.exchange_residuals(study).why
    smooth = replace(study.campaigns[1], logs={**study.campaigns[1].logs, RPCM: study.logs[RPCM]})
    verdict = findings.exchange_residuals(replace(study, campaigns=(study.campaign, smooth))).why
    assert "Models of the arm without friction, on its own exchange, have" in verdict


def _test_of(errors, u):
    """The test of residuals that are known: a model of zero leaves the output itself."""
    model = StateSpace(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), np.zeros((3, 3)), None, 0.02)
    return sysid.resid(model, IOData(u, errors, 0.02))


def test_lags_are_counted_where_they_are():
    rng = np.random.default_rng(3)
    u, e = rng.standard_normal((2, 6000, 3))
    white = findings.outside_share(_test_of(e, u))
    assert max(white.values()) <= findings.FAIRLY_WHITE
    coloured = e.copy()
    coloured[:, 1] = np.convolve(e[:, 1], np.ones(20), mode="full")[: len(e)]
    share = findings.outside_share(_test_of(coloured, u))
    assert share[SHOULDER] > 0.5
    assert share[YAW] == white[YAW]
    early, late = e.copy(), e.copy()
    early[:, 0] += np.roll(u[:, 0], 5)
    late[:, 0] += np.roll(u[:, 0], 20)
    first, second = findings.dependence(_test_of(early, u))
    assert first == pytest.approx(1 / 14, abs=0.08)
    assert second == pytest.approx(0.0, abs=0.1)
    assert findings.dependence(_test_of(late, u))[1] >= 1 / 11


def test_a_coupling_is_found_at_its_input():
    rng = np.random.default_rng(4)
    u, e = rng.standard_normal((2, 6000, 3))
    e[:, 0] += 0.3 * np.roll(u[:, 2], 3)
    test = _test_of(e, u)
    value, outside = findings.peak(test, 0, 2)
    assert outside
    assert value == pytest.approx(0.3 / np.sqrt(1.09), abs=0.04)
    assert findings.peak(test, 0, 1)[0] < 0.1


@pytest.mark.parametrize(
    ("record", "keys"),
    [
        (RPCM, ("F18", "F19")),
        ("mimo-12", ("F20",)),
        ("mimo-10", ("F21",)),
        ("siso-5-elbow_pitch", ("F26",)),
        ("siso-7-elbow_pitch", ("F5",)),
    ],
)
def test_what_has_no_record_is_not_decided(study, record, keys):
    poor = without_log(study, record, "the arm met the worksite")
    for key in keys:
        with pytest.raises(MissingRecordError, match=f"{record}: the arm met the worksite"):
            FINDINGS[key](poor)

"""Findings on what the three-joint models are."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.thesis import findings_chapter_6 as findings
from scenarios.thesis.outcome import numbers
from sysid import StateSpace
from tests.scenarios.thesis.altered import with_model, with_models


def test_the_printed_models_have_the_roots_that_the_thesis_tells(study):
    printed = [entry for entry in study.multivariable.models if entry.printed]
    ours = [replace(entry, name=entry.name.removeprefix("printed "), printed=False) for entry in printed]
    assert findings.real_poles(with_models(study, [*printed, *ours])).verdict == "reproduced"


def test_roots_are_counted(study):
    assert findings.complex_roots(np.array([1.0, 0.5 + 0.1j, 0.5 - 0.1j, 0.3 + 1e-9j])) == 2
    verdict = numbers(findings.real_poles(study))
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


def test_coupling_is_told_band_by_band(study):
    verdict = findings.coupling(study)
    bands = [name.removeprefix("elbow_pitch, ") for name in numbers(verdict) if name.startswith("elbow_pitch, ")]
    assert bands == ["0.1 Hz to the bandwidth", "3 to 5 Hz", "5 to 10 Hz"]
    shares = [numbers(verdict)[f"elbow_pitch, {band}"] for band in bands]
    assert shares == sorted(shares)
    truth = study.multivariable.truth
    gain = np.abs(truth.frequency_response(np.array([5.0]))[0])
    joint = list(study.joints).index("elbow_pitch")
    assert numbers(verdict)["elbow_pitch, 3 to 5 Hz"] >= 99.9 * (gain[joint].sum() / gain[joint, joint] - 1)
    assert verdict.verdict == "partly", "little below the bandwidth, not in the bands above"
    assert all(0.0 < numbers(verdict)[f"motion with {joint}"] < findings.LITTLE for joint in study.joints)


def test_a_diagonal_arm_has_little_coupling(study):
    alone = replace(study, multivariable=replace(study.multivariable, truth=study.multivariable.model("OKID").model))
    assert findings.coupling(alone).verdict == "reproduced"

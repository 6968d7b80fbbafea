"""F14 and F15: verdicts follow from the records."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS
from scenarios.thesis.findings_chapter_5 import OFFSET, SLACK, percent_described, without_detrending
from scenarios.thesis.outcome import numbers
from scenarios.truth.published import PERCENT_DESCRIBED
from tests.scenarios.thesis.altered import with_log


def test_share_is_laid_beside_the_printed_one(study):
    verdict = percent_described(study)
    assert set(numbers(verdict)) == set(PERCENT_DESCRIBED)
    passed = sum(value >= PERCENT_DESCRIBED[name] - SLACK for name, value in numbers(verdict).items())
    assert verdict.verdict == {3: "reproduced", 0: "not reproduced"}.get(passed, "partly")
    assert "no more than 5 singular values" in verdict.why
    yaw = 100 - numbers(verdict)["shoulder_yaw"]
    assert f"what two states do not describe is {yaw:.2g} (printed 0.13)" in verdict.why


def test_a_common_mean_does_no_harm_and_a_bias_of_one_channel_does(study):
    name = "siso-5-shoulder_yaw"
    log = study.campaign.log(name)
    biased_log = replace(log, measured=log.measured + OFFSET * (np.array(JOINTS) == "shoulder_yaw"))
    plain, biased = without_detrending(study), without_detrending(with_log(study, name, biased_log))
    assert plain.verdict == "not reproduced"
    for name, value in numbers(plain).items():
        assert np.isfinite(value), name
    assert numbers(plain)["residual of order 4 over detrended order 2"] < 1.2
    order = "order for the same percent"
    assert numbers(plain)[order] < 4 <= numbers(biased)[order]
    assert biased.verdict == "partly"
    # What detrending takes off is the same in both.
    detrended = "observer parameters needed, detrended"
    assert numbers(biased)[detrended] == pytest.approx(numbers(plain)[detrended])
    # The bias that is laid beside it is in the numbers, so that other seeds tell whether it explains anything.
    assert numbers(plain)["order with a bias of one channel"] == pytest.approx(numbers(biased)[order])
    assert numbers(plain)["residual of order 4 with it"] == pytest.approx(
        numbers(biased)["residual of order 4 over detrended order 2"]
    )

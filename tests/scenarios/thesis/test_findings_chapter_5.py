"""F14 and F15: verdicts follow from the records."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS
from scenarios.experiments.log_review import settled
from scenarios.thesis.finding import CLAIMS
from scenarios.thesis.findings_chapter_5 import percent_described, without_detrending
from scenarios.truth.published import PERCENT_DESCRIBED
from tests.scenarios.thesis.altered import with_log


def test_the_remainder_is_laid_beside_the_printed_one(study):
    decided = percent_described(study)
    assert set(decided.value) == set(PERCENT_DESCRIBED)
    factor = CLAIMS["F14"].limits["factor"]
    for name, printed in PERCENT_DESCRIBED.items():
        ratio = (100 - decided.value[name]) / (100 - printed)
        assert decided.parts[name.replace("_", " ")] == (1 / factor <= ratio <= factor)
    yaw = 100 - decided.value["shoulder_yaw"]
    assert f"What two states leave is {yaw:.2g} (printed 0.13)" in decided.why


@pytest.mark.parametrize(
    ("times", "verdict"), [(1.0, "reproduced by construction"), (1e-3, "not reproduced"), (4.0, "not reproduced")]
)
def test_a_remainder_far_from_the_printed_one_is_no_success_on_either_side(study, monkeypatch, times, verdict):
    joints = {id(entry.models["okid"].estimate): name for name, entry in study.joints.items()}
    monkeypatch.setattr(
        "scenarios.thesis.findings_chapter_5.hankel_share",
        lambda estimate, *_, **__: 100 - times * (100 - PERCENT_DESCRIBED[joints[id(estimate)]]),
    )
    assert percent_described(study).verdict == verdict


def test_a_common_mean_does_little_harm_and_the_bias_tried_beside_is_one_of_the_record(study):
    name = "siso-5-shoulder_yaw"
    log = study.campaign.log(name)
    bias = CLAIMS["F15"].limits["bias"] * settled(log, "shoulder_yaw").y.std()
    biased_log = replace(log, measured=log.measured + bias * (np.array(JOINTS) == "shoulder_yaw"))
    plain, biased = without_detrending(study), without_detrending(with_log(study, name, biased_log))
    for name, value in plain.value.items():
        assert np.isfinite(value), name
    assert plain.value["residual of order 4 over detrended order 2"] < 1.2
    order = "order for the same percent"
    assert plain.parts["order 4"] == (plain.value[order] >= 4)
    # What detrending takes off is the same in both.
    detrended = "observer parameters needed, detrended"
    assert biased.value[detrended] == pytest.approx(plain.value[detrended])
    # The bias that is laid beside it is in the numbers, so that other seeds tell whether it explains anything.
    assert plain.value["order with a bias of one channel"] == pytest.approx(biased.value[order])
    assert plain.value["residual of order 4 with it"] == pytest.approx(
        biased.value["residual of order 4 over detrended order 2"]
    )

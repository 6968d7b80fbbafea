"""Chapter VI on the page: how unlike the exchange is to what models come from."""

import numpy as np
import pytest

from hmtb_twin import JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.log_review import SETTLING
from scenarios.thesis.chapter_6 import chapter_6, departure


def test_the_arm_goes_far_from_the_operating_point_with_the_unit_part_of_the_time(study):
    log, away = study.campaign.log(RPCM), departure(study)
    yaw = JOINTS.index("shoulder_yaw")
    settled = log.true_angles[round(SETTLING / log.dt) :, yaw]
    assert away["shoulder_yaw"] == pytest.approx(np.abs(settled - study.truth.angles[yaw]).max())
    assert np.degrees(max(away.values())) > 10.0
    assert 0.0 < chapter_6(study)["exchange"]["loaded"] < 100.0

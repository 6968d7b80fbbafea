from typing import Any

import numpy as np
import pytest

from hmtb_twin import JOINTS, Truth, TwinError, load_arm


@pytest.mark.parametrize("names", [5, None, {}, "elbow_pitch", (), ("elbow_pitch", "elbow_pitch"), {"elbow_pitch"}])
def test_a_subset_takes_joints_each_once(truth: Truth, names: Any) -> None:
    for arguments in ((names, JOINTS), (JOINTS, names)):
        with pytest.raises(TwinError, match="expected one or more joints, each once"):
            truth.subset(*arguments)


@pytest.mark.parametrize("name", [5, None, ["elbow_pitch"], np.array(["elbow_pitch", "ankle"]), "ankle"])
def test_what_is_no_joint_is_named(truth: Truth, name: Any) -> None:
    for ask in (truth.joint, lambda one: truth.channel("elbow_pitch", one)):
        with pytest.raises(TwinError, match=r"unknown joint .*, available: .*elbow_pitch"):
            ask(name)


@pytest.mark.parametrize("name", [["nominal"], {}, None, 1, np.array(["nominal", "flight"])])
def test_what_is_no_arm_is_named(name: Any) -> None:
    with pytest.raises(TwinError, match=r"unknown variant .*, available: nominal"):
        load_arm(variant=name)
    with pytest.raises(TwinError, match=r"unknown payload .*, available: .*rpcm"):
        load_arm(payload=name)

import mujoco
import numpy as np

from hmtb_twin import load_arm
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.parameters.variants import OPERATING_POSE
from hmtb_twin.run.live_run import Frame


def test_the_arm_stands_where_mujoco_puts_it(served):
    arm = load_arm()
    served.scene.load(arm)
    angles = arm.pose(OPERATING_POSE) + 0.1
    served.scene.show(Frame(0, angles, angles - 0.05, np.array([30.0, 0, 0, 0, 0, 0]), 0))
    model = scene_model(arm)
    data = mujoco.MjData(model)
    for handles, shown in ((served.scene._bodies, angles), (served.scene._ghost, angles - 0.05)):
        data.qpos[: len(shown)] = shown
        mujoco.mj_kinematics(model, data)
        for body, handle in handles.items():
            np.testing.assert_allclose(handle.position, data.xpos[body], atol=1e-6)
    assert served.scene._arrow.visible
    assert len(served.scene._ghost) < len(served.scene._bodies)


def test_every_camera_of_the_flight_deck_is_there(served):
    assert {"overview", "window", "port", "starboard", "wrist_camera"} <= set(served.scene.cameras)

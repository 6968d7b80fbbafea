import mujoco
import numpy as np
import pytest

from hmtb_twin import load_arm
from hmtb_twin.arm.meshes import SHOWN, body_meshes
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.parameters.values import OPERATING_POSE
from hmtb_twin.run.live_run import Frame


@pytest.mark.parametrize("payload", ["rpcm", "none"])
def test_meshes_have_the_size_of_the_geoms(payload):
    """Corner for corner as MuJoCo has them: its own bounding boxes hold the meshes tightly."""
    model = scene_model(load_arm(payload=payload))
    for body, mesh in body_meshes(model).items():
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for geom in range(model.ngeom):
            if model.geom_bodyid[geom] != body or model.geom_group[geom] not in SHOWN:
                continue
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
                break
            centre, half = model.geom_aabb[geom].reshape(2, 3)
            rotation = np.empty(9)
            mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
            signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
            corners = model.geom_pos[geom] + (centre + signs * half) @ rotation.reshape(3, 3).T
            low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
        else:
            assert (mesh.bounds[0] >= low - 1e-6).all()
            assert (mesh.bounds[1] <= high + 1e-6).all()


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

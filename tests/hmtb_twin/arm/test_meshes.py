import mujoco
import numpy as np
import pytest

from hmtb_twin import load_arm
from hmtb_twin.arm.meshes import SHOWN, body_meshes
from hmtb_twin.arm.rendering import scene_model

pytest.importorskip("trimesh")


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

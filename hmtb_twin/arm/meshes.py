"""Meshes of a model's bodies, for viewers that draw no geoms of MuJoCo."""

from typing import TYPE_CHECKING, cast

import mujoco
import numpy as np

if TYPE_CHECKING:
    import trimesh

SHOWN = (0, 1, 2)
"""Groups of geoms that MuJoCo's viewer shows."""


def body_meshes(model: mujoco.MjModel) -> "dict[int, trimesh.Trimesh]":
    """Return one coloured mesh in the frame of each body that has visible geoms, by the body's number."""
    import trimesh

    meshes: dict[int, list[trimesh.Trimesh]] = {}
    for geom in range(model.ngeom):
        if model.geom_group[geom] not in SHOWN:
            continue
        mesh = _geom_mesh(model, geom)
        pose = np.eye(4)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), model.geom_pos[geom]
        mesh.apply_transform(pose)
        material = model.geom_matid[geom]
        # As in MuJoCo, a material's colour takes precedence over the geom's own.
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        if rgba[3] == 0.0:
            continue
        mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=np.rint(255 * rgba).astype(np.uint8))
        meshes.setdefault(int(model.geom_bodyid[geom]), []).append(mesh)
    bodies = {}
    for body, body_parts in meshes.items():
        bodies[body] = cast(trimesh.Trimesh, trimesh.util.concatenate(body_parts))
    return bodies


def _geom_mesh(model: mujoco.MjModel, geom: int) -> "trimesh.Trimesh":
    """Return the mesh of a geom in its own frame; MuJoCo's sizes are halves."""
    from trimesh import Trimesh, creation

    shape, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if shape == mujoco.mjtGeom.mjGEOM_MESH:
        number = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        first_face, face_count = model.mesh_faceadr[number], model.mesh_facenum[number]
        vertices = model.mesh_vert[first : first + count]
        return Trimesh(vertices, model.mesh_face[first_face : first_face + face_count], process=False)
    if shape == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        ball = creation.icosphere(subdivisions=2)
        return Trimesh(ball.vertices * size, ball.faces, process=False)
    if shape == mujoco.mjtGeom.mjGEOM_BOX:
        return creation.box(2.0 * size)
    if shape == mujoco.mjtGeom.mjGEOM_SPHERE:
        return creation.icosphere(subdivisions=2, radius=size[0])
    if shape == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return creation.cylinder(size[0], 2.0 * size[1], sections=32)
    if shape == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return creation.capsule(2.0 * size[1], size[0], count=(16, 24))
    if shape == mujoco.mjtGeom.mjGEOM_PLANE:
        # A size of zero means an infinite plane: ten metres do for an arm.
        return creation.box((2.0 * (size[0] or 5.0), 2.0 * (size[1] or 5.0), 0.002))
    known = "box, sphere, ellipsoid, cylinder, capsule, plane or mesh"
    raise ValueError(f"a geom of type {shape.name} has no shape here; expected {known}")

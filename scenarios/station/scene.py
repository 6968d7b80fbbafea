"""The arm in the browser: a mesh for each body, moved by forward kinematics."""

import threading
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.arm.meshes import body_meshes
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.run.live_run import Frame

if TYPE_CHECKING:
    import viser

GHOST = (0.0, 114.0, 178.0)
"""Colour of the commanded arm."""

NEWTONS_PER_METRE = 200.0
"""Wrist force that is drawn as an arrow of one metre."""

TOOL = "tool"
"""Site at which the wrist force is drawn."""

SHORTEST_ARROW = 0.02
"""Arrows below this length are not drawn, m."""


class Scene:
    """The worksite with the arm, the ghost of its command and the wrist force.

    Args:
        server: The page; all its browsers see the same scene.
        arm: The arm to begin with.

    Attributes:
        arm: The arm that is shown.
    """

    def __init__(self, server: "viser.ViserServer", arm: Arm) -> None:
        self._server = server
        server.scene.set_up_direction("+z")
        server.scene.world_axes.visible = False
        server.scene.configure_default_lights(enabled=True)
        self._ghost_visible = True
        self._lock = threading.RLock()
        self.load(arm)

    def load(self, arm: Arm) -> None:
        """Show another arm, or the same with another payload; both stand at the arm's operating pose until `show`."""
        scene, model = self._server.scene, scene_model(arm)
        with self._lock, self._server.atomic():
            self.arm = arm
            self._model: mujoco.MjModel = model
            self._data = mujoco.MjData(model)
            for root in ("/arm", "/ghost"):
                scene.remove_by_name(root)
            meshes = body_meshes(model)
            # By name: a browser may draw a frame where one of the same name stood, and fixed bodies move no more.
            names = {body: model.body(body).name for body in meshes}
            tree = model.body_treeid[model.jnt_bodyid[0]]
            self._bodies: dict[int, viser.FrameHandle] = {
                body: scene.add_frame(f"/arm/{names[body]}", show_axes=False) for body in meshes
            }
            for body, mesh in meshes.items():
                scene.add_mesh_trimesh(f"/arm/{names[body]}/mesh", mesh)
            self._ghost: dict[int, viser.FrameHandle] = {
                body: scene.add_frame(f"/ghost/{names[body]}", show_axes=False, visible=self._ghost_visible)
                for body in meshes
                # The arm's own bodies: the worksite has no command.
                if model.body_treeid[body] == tree
            }
            for body in self._ghost:
                mesh = meshes[body]
                scene.add_mesh_simple(
                    f"/ghost/{names[body]}/mesh",
                    mesh.vertices,
                    mesh.faces,
                    color=GHOST,
                    opacity=0.25,
                    cast_shadow=False,
                )
            # Shapes that a machine's own file brings have no tool: its place is that of the model that is simulated.
            self._has_tool = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, TOOL) >= 0
            self._tool_data = self._data if self._has_tool else mujoco.MjData(arm.model)
            self._tool_model = model if self._has_tool else arm.model
            self._tool = self._tool_model.site(TOOL).id
            self._arrow = scene.add_arrows(
                "/arm/force",
                np.zeros((1, 2, 3)),
                (213, 94, 0),
                shaft_radius=0.008,
                head_radius=0.02,
                head_length=0.05,
                visible=False,
            )
        angles = arm.pose(arm.description.operating_pose)
        self.show(Frame(0, angles, angles, np.zeros(6), 0))

    @property
    def cameras(self) -> tuple[str, ...]:
        """Cameras of the worksite, those of the aft flight deck among them."""
        return tuple(self._model.camera(i).name for i in range(self._model.ncam))

    def show_ghost(self, *, visible: bool) -> None:
        """Show or hide the ghost of the command."""
        self._ghost_visible = visible
        for handle in self._ghost.values():
            handle.visible = visible

    def show(self, frame: Frame) -> None:
        """Show the arm of a frame."""
        # Sent as one: no browser draws an arm of which only some bodies have moved.
        with self._lock, self._server.atomic():
            if self._ghost_visible:
                self._place(self._ghost, frame.command, frame.unit_pose)
            self._place(self._bodies, frame.angles, frame.unit_pose)
            if not self._has_tool:
                self._tool_data.qpos[: len(frame.angles)] = frame.angles
                mujoco.mj_kinematics(self._tool_model, self._tool_data)
            tip = self._tool_data.site_xpos[self._tool]
            # The sensor measures what the arm exerts on what it holds; what the arm feels is drawn, a weight downwards.
            force = -self._tool_data.site_xmat[self._tool].reshape(3, 3) @ frame.wrench[:3] / NEWTONS_PER_METRE
            long = float(np.linalg.norm(force)) > SHORTEST_ARROW
            self._arrow.visible = long
            if long:
                self._arrow.points = np.array([[tip, tip + force]], dtype=np.float32)

    def _place(self, handles: "dict[int, viser.FrameHandle]", angles: np.ndarray, unit: np.ndarray | None) -> None:
        self._data.qpos[: len(angles)] = angles
        if unit is not None:
            self._data.qpos[len(angles) : len(angles) + len(unit)] = unit
        mujoco.mj_kinematics(self._model, self._data)
        for body, handle in handles.items():
            handle.position, handle.wxyz = self._data.xpos[body], self._data.xquat[body]

    def look_through(self, client: "viser.ClientHandle", camera: str) -> None:
        """Put the eye of one browser where a camera of the worksite stands now."""
        # `_place` computes bodies and sites, but no cameras.
        mujoco.mj_camlight(self._model, self._data)
        number = self._model.camera(camera).id
        # A camera of MuJoCo looks along its negative z axis, with y upwards.
        eye, axes = self._data.cam_xpos[number].copy(), self._data.cam_xmat[number].reshape(3, 3)
        with client.atomic():
            client.camera.up_direction = axes[:, 1]
            client.camera.position = eye
            client.camera.look_at = eye - axes[:, 2]
            client.camera.fov = float(np.radians(self._model.cam_fovy[number]))

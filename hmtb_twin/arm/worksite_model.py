"""The arm at its worksite: the replacement unit as a free body with a latch, and contact where it is needed."""

import mujoco
import numpy as np

from hmtb_twin.arm.rigid_bodies import spec_of_test_bed
from hmtb_twin.parameters.variants import LINKS
from hmtb_twin.parameters.worksite import LATCH, TOUCH, UNIT

UNIT_BODY = "rpcm"
"""Body of the replacement unit; its frame is the tool's when it is held exactly."""

LATCH_WELD = "latch"
"""The constraint by which the end effector holds the unit."""

TOUCH_SENSOR = "unit_touch"
"""Sensor of the sum of normal contact forces between unit and worksite, N, with its history over the last tick."""


def worksite_spec(timestep: float) -> mujoco.MjSpec:
    """Return the scene with the unit as a free body.

    Contact is on between the unit and walls, guides and panel, and between the unit and the finger tips, nowhere else.
    The latch is a stiff weld, open at first.

    Args:
        timestep: Physics step, s.

    Returns:
        The scene, its keyframes left out: their state would not fit the free body.
    """
    spec = spec_of_test_bed("scene.xml")
    spec.option.timestep = timestep
    # Beside the inertia of the pin the default would end the search for contact forces too early for a light joint.
    spec.option.tolerance = 1e-16
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    _free_unit(spec)
    _add_fingertips(spec)
    for geom in spec.geoms:
        if geom.conaffinity:
            _set_contact(geom)
    return spec


def _free_unit(spec: mujoco.MjSpec) -> None:
    """Separate the unit from the end effector; give it a free joint, a latch and a touch sensor."""
    fixed = spec.body(UNIT_BODY)
    grip = fixed.pos.copy()
    unit = _add_copy(spec, fixed)
    spec.delete(fixed)
    # Named only now: two bodies of one name are an error.
    unit.name = UNIT_BODY
    unit.add_freejoint(name=UNIT_BODY)
    body = unit.geoms[0]
    body.contype = 1
    _set_contact(body)
    _add_touch_sensor(spec, unit)
    _add_latch(spec, grip)


def _add_copy(spec: mujoco.MjSpec, fixed: mujoco.MjsBody) -> mujoco.MjsBody:
    """Add a body to the world with mass and shapes of a given one; nothing touches it yet."""
    copy = spec.worldbody.add_body(
        mass=fixed.mass, ipos=fixed.ipos, iquat=fixed.iquat, inertia=fixed.inertia, explicitinertial=True
    )
    for geom in fixed.geoms:
        copy.add_geom(
            type=geom.type,
            pos=geom.pos,
            quat=geom.quat,
            size=geom.size,
            material=geom.material,
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=geom.group,
        )
    return copy


def _add_touch_sensor(spec: mujoco.MjSpec, unit: mujoco.MjsBody) -> None:
    """Add the sensor of contact forces, whose zone is a box round the unit, without its end at the fingers."""
    # The sensor's zone excludes the end at the fingers, whose touch is no contact with the worksite.
    margin, edge = 0.01, 0.01
    x, y, z = (side / 2 for side in UNIT.size)
    unit.add_site(
        name=TOUCH_SENSOR,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[x + edge / 2 + margin / 2, 0.0, 0.0],
        size=[x - edge / 2 + margin / 2, y + margin, z + margin],
        group=4,
    )
    spec.add_sensor(
        name=TOUCH_SENSOR,
        type=mujoco.mjtSensor.mjSENS_TOUCH,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=TOUCH_SENSOR,
    )


def _add_latch(spec: mujoco.MjSpec, grip: np.ndarray) -> None:
    """Add the weld that holds the unit at its grip in the end effector, open at first."""
    latch = spec.add_equality(
        name=LATCH_WELD,
        type=mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1="end_effector",
        name2=UNIT_BODY,
        active=False,
        solref=[LATCH.time_constant, LATCH.damping_ratio],
        solimp=[0.9999, 0.9999, 0.001, 0.5, 2.0],
    )
    # Anchor, then the pose of the unit in the end effector, then the weight of rotation.
    latch.data[:11] = [0.0, 0.0, 0.0, *grip, 1.0, 0.0, 0.0, 0.0, 1.0]


def _add_fingertips(spec: mujoco.MjSpec) -> None:
    """Give the fingers spheres that touch the unit; their visible shapes do not."""
    hand = spec.body("end_effector")
    radius = 0.006
    reach = LINKS["end_effector"].length - LATCH.pad - radius
    for side in (1.0, -1.0):
        for across in (0.012, -0.012):
            hand.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                pos=[reach, side * 0.035, across],
                size=[radius, 0.0, 0.0],
                mass=0.0,
                contype=0,
                conaffinity=1,
                group=4,
            )


def _set_contact(geom: mujoco.MjsGeom) -> None:
    """Give a geom the friction and firmness of the contacts at the worksite."""
    # Sliding friction alone; the rolling and torsional coefficients are MuJoCo's defaults and not used.
    geom.condim = 3
    geom.friction = [TOUCH.friction, 0.005, 0.0001]
    geom.solref = [TOUCH.time_constant, 1.0]

"""Small-signal truth: finite differences of the physics, lifted to the rate of the position loop."""

from collections.abc import Sequence
from copy import copy
from numbers import Real

import mujoco
import numpy as np
from scipy.linalg import block_diag

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.bus.joint_log import software_versions
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.files.errors import OverloadError, TwinError
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.values import SAMPLE_TIME, Motion
from hmtb_twin.truth.innovations import Disturbances, innovations_form
from hmtb_twin.truth.truth import Truth
from sysid import StateSpace

CLEARANCE = 1e-3
"""Smallest distance of a joint from its stop, rad: ten steps of the finite differences, which must not touch it."""

INDEX = 0.0
"""Angle at which the pin of an indexed joint holds it, rad."""

AT_INDEX = 1e-9
"""Tolerance of the angle of an indexed joint, rad: a deflected pin acts with its stiffness."""


def check_range(angles: np.ndarray, arm: ArmDescription) -> None:
    """Refuse a pose (n,), rad, that cannot be linearised: a joint at its stop, or an indexed joint off its pin."""
    for name, angle in zip(arm.joints, angles, strict=True):
        message = f"pose: {name} = {np.degrees(angle):g} deg given, expected"
        if name in arm.indexed:
            if abs(angle - INDEX) > AT_INDEX:
                raise TwinError(f"{message} {np.degrees(INDEX):g} deg, where its pin holds it")
        elif not clear_of_stops(arm.motions[name], float(angle)):
            low, high = np.degrees((arm.motions[name].lower, arm.motions[name].upper))
            raise TwinError(f"{message} between {low:g} and {high:g} deg, at least {CLEARANCE:g} rad off the stops")


def clear_of_stops(motion: Motion, angle: float) -> bool:
    """Return whether a joint of a range moves freely either way at an angle in rad."""
    return motion.lower + CLEARANCE <= angle <= motion.upper - CLEARANCE


STEP, SPOOL_STEP = 1e-5, 1e-6
"""Step of the centred differences, and that with servo valves: far within the spool's null, at more rounding."""


def sample_map(
    model: mujoco.MjModel, rest: mujoco.MjData, *, period: float = SAMPLE_TIME, step: float = SPOOL_STEP
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate the state after one tick by the state before it and by the controls held over it.

    Args:
        model: The model; all joints are hinges.
        rest: The state about which to differentiate, at rest, with its controls.
        period: Another length than that of a tick, s: a whole number of physics steps.
        step: Step of the differences, in the units of the states and controls.

    Returns:
        A (n, n) and B (n, nu) of the map, with n = 2 nv + na: angles, velocities, activations.
    """
    precise = copy(model)
    # Brakes of electric drives are constraints: solved only to the default tolerance they would blur the differences.
    precise.opt.tolerance = 0.0
    data = mujoco.MjData(precise)
    substeps = round(period / precise.opt.timestep)
    point = np.concatenate([rest.qpos, rest.qvel, rest.act, rest.ctrl])
    states = len(point) - precise.nu
    cuts = np.cumsum([precise.nq, precise.nv, precise.na])

    def after(start: np.ndarray) -> np.ndarray:
        # Without the reset, warm starts of the solver would carry over from one difference to the next.
        mujoco.mj_resetData(precise, data)
        data.eq_active[:] = rest.eq_active
        data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:] = np.split(start, cuts)
        mujoco.mj_step(precise, data, nstep=substeps)
        return np.concatenate([data.qpos, data.qvel, data.act])

    columns = []
    for shift in step * np.eye(len(point)):
        columns.append((after(point + shift) - after(point - shift)) / (2.0 * step))
    jacobian = np.column_stack(columns)
    return jacobian[:, :states], jacobian[:, states:]


AMPLITUDES = (1e-5, 1e-4, 1e-3, 1e-2)
"""Command amplitudes at which the linear model is compared with simulation, rad."""

LARGEST_AMPLITUDE = 2.0 * np.pi
"""A whole turn, more than any command of the arm, rad."""

METHOD = "centred differences of the 50 Hz map"
"""Method of linearisation."""


def linearize(arm: Arm, pose: str | np.ndarray | None = None, *, amplitudes: Sequence[float] = AMPLITUDES) -> Truth:
    """Linearise the arm at rest and lift the result to 50 Hz.

    One tick is x+ = f(x, u) with x joint angles, velocities and states of the drives and u commanded angle and
    feedforward torque of each joint. This 50 Hz map of the simulation itself is differentiated, at rest with the oil
    settled; the feedforward of the controller's own model folds the torques into the commanded angles, and the bus
    delays follow the outputs. Dry friction is off: at rest it would show the stuck arm, not the moving one. The oil's
    drag stays. Noise of the valve drives is torque held over a tick as the feedforward is, so that it enters by the
    same columns of the map.

    Args:
        arm: The arm, with friction or without, in free space or at the worksite: the truth is the same.
        pose: Operating point, by name or as joint angles (7,), rad; the operating pose of the arm by default.
        amplitudes: Command amplitudes at which the truth is compared with simulation, rad. Without any, linearisation
            takes milliseconds, hundreds of times less.

    Returns:
        The truth, with its error against simulation. The arm may be unstable: `Truth.spectral_radius`.

    Raises:
        TwinError: An amplitude is not above 0 and up to `LARGEST_AMPLITUDE`, there is no such pose, the angles are not
            one finite number for each joint, a joint is out of its range or less than `joint_range.CLEARANCE` from a
            stop, or an indexed joint is not at its index: there the stop or the pin would be linearised with the servo.
        OverloadError: The drives cannot hold the arm there, or servo valves under load let a joint sink onto its stop.
    """
    if isinstance(amplitudes, str) or not isinstance(amplitudes, Sequence | np.ndarray):
        raise TwinError(f"amplitudes = {amplitudes!r} given, expected a sequence of numbers in rad")
    smooth = sliding(arm)
    pose = arm.description.operating_pose if pose is None else pose
    angles = smooth.pose(pose) if isinstance(pose, str) else _angles(pose, len(arm.joints))
    # Checked once more where the arm rests, which may be lower than commanded.
    check_range(angles, arm.description)
    path, disturbances = _sampled_model(smooth, angles)
    model = innovations_form(path, disturbances.drives, disturbances.resolvers)
    errors = {amplitude: small_signal_error(smooth, model, angles, amplitude) for amplitude in amplitudes}
    pose_name = pose if isinstance(pose, str) else "given angles"
    return Truth(
        model=model,
        disturbances=disturbances,
        variant=arm.variant,
        payload=arm.payload,
        plant=arm.plant,
        specimen=arm.specimen,
        pose=pose_name,
        angles=angles,
        small_signal_error=errors,
        provenance={"method": METHOD, **software_versions()},
    )


def sliding(arm: Arm) -> Arm:
    """Return the arm in free space without dry friction: the moving arm of small signals."""
    if not arm.worksite and not arm.friction:
        # Its valves or step may differ from those of `load_arm`.
        return arm
    return load_arm(arm.variant, arm.payload, plant=arm.plant, specimen=arm.specimen, friction=False)


def _angles(pose: np.ndarray, count: int) -> np.ndarray:
    """Return a pose given by its angles (7,), rad; raises `TwinError` for anything else."""
    try:
        array = np.asarray(pose)
    except ValueError:  # rows of unequal length
        array = np.empty(0, dtype=object)
    # Numpy would also turn texts, truth values and complex numbers into floats.
    angles = array.astype(float) if array.dtype.kind in "iuf" else np.empty(0)
    if angles.shape != (count,) or not np.isfinite(angles).all():
        raise TwinError(f"pose {pose!r} given, expected a name or {count} finite joint angles in rad")
    return angles


def _sampled_model(arm: Arm, angles: np.ndarray) -> tuple[StateSpace, Disturbances]:
    """Return the 50 Hz model from commanded to measured angles at a pose, and the noise that acts on it."""
    data = arm.rest(angles)
    for name, angle in zip(arm.joints, data.qpos, strict=True):
        if not clear_of_stops(arm.description.motions[name], float(angle)):
            raise OverloadError(
                f"at {arm.plant.supply_pressure:g} MPa the drives let the {name.replace('_', ' ')} sink onto its stop, "
                f"to {np.degrees(angle):g} deg"
            )
    step = SPOOL_STEP if arm.plant.actuator == "orifice" else STEP
    A, B = sample_map(arm.model, data, period=arm.description.sample_time, step=step)
    states = len(A)
    # Controls are commanded angle and feedforward torque of each joint in turn; the torque follows the command.
    torques = B[:, 1::2]
    B = B[:, 0::2] + torques @ arm.controller.gravity_gradient(angles)
    n = len(arm.joints)
    path = _delayed(A, B, np.eye(n, states), arm)
    drives = np.zeros((path.order, n))
    drives[:states] = torques * arm.process_noise
    # The bus delays readings and angles alike; delayed white noise is white noise.
    recorder = arm.specimen.recorder(arm.description)
    resolvers = (recorder.noise**2 + recorder.resolver_step**2 / 12.0) * np.eye(n)
    return path, Disturbances(drives, resolvers)


def _delayed(A: np.ndarray, B: np.ndarray, C: np.ndarray, arm: Arm) -> StateSpace:
    """Append to each output the shift register of its bus delay."""
    delays, joints = arm.delays, arm.joints
    registers = [np.eye(delay, k=-1) for delay in delays]
    shift = block_diag(*registers) if delays.any() else np.zeros((0, 0))
    # Into the first place of each register, out of its last; outputs without a delay are read directly.
    feed, read, direct = np.zeros((len(shift), len(C))), np.zeros((len(C), len(shift))), C.copy()
    first = 0
    for output, delay in enumerate(delays):
        if delay:
            feed[first, output] = 1.0
            read[output, first + delay - 1] = 1.0
            direct[output] = 0.0
            first += delay
    dynamics = np.block([[A, np.zeros((len(A), len(shift)))], [feed @ C, shift]])
    inputs = np.vstack([B, np.zeros((len(shift), B.shape[1]))])
    outputs = np.hstack([direct, read])
    feedthrough = np.zeros((len(C), B.shape[1]))
    return StateSpace(
        dynamics,
        inputs,
        outputs,
        feedthrough,
        None,
        arm.description.sample_time,
        input_names=tuple(f"{name} commanded" for name in joints),
        output_names=tuple(f"{name} measured" for name in joints),
        input_units=("rad",) * len(joints),
        output_units=("rad",) * len(joints),
    )


def small_signal_error(arm: Arm, model: StateSpace, angles: np.ndarray, amplitude: float) -> float:
    """Compare the linear model with simulation from the same commands.

    Args:
        arm: The arm, without friction.
        model: Its linear model.
        angles: Operating point (7,), rad.
        amplitude: Amplitude of a pseudo-random binary command, rad.

    Returns:
        Root mean square of the difference over that of the response, largest over the studied joints, each excited
        alone for 4 s. NaN where there is nothing to compare: the linear model is unstable, or either response is none
        or not finite.

    Raises:
        TwinError: The amplitude is not a number above 0 and up to `LARGEST_AMPLITUDE`.
    """
    is_number = isinstance(amplitude, Real) and not isinstance(amplitude, bool)
    if not (is_number and 0.0 < amplitude <= LARGEST_AMPLITUDE):
        raise TwinError(f"amplitude {amplitude!r} given, expected above 0 and up to {LARGEST_AMPLITUDE:.4g} rad")
    # The response of an unstable model grows without bound and says nothing of its error.
    if model.order and not np.abs(np.linalg.eigvals(model.A)).max() < 1.0:
        return np.nan
    # Binary commands held for five ticks excite the band of the servo and keep their amplitude at every instant.
    # The seed is fixed, so that a truth does not depend on chance.
    bits = np.random.default_rng(0).choice([-amplitude, amplitude], 40)
    offsets = np.repeat(bits, 5)
    largest_error = 0.0
    for name in arm.description.compared:
        j = arm.description.joint_index(name)
        command = np.tile(angles, (len(offsets), 1))
        command[:, j] += offsets
        response = linear(model, command - angles)[:, j]
        difference = simulated(arm, angles, command)[:, j] - response
        # Without a response, or with one that overflows, the quotient is not finite: reported as NaN, without warnings.
        with np.errstate(invalid="ignore", divide="ignore"):
            error = np.linalg.norm(difference) / np.linalg.norm(response)
        if not np.isfinite(error):
            return np.nan
        largest_error = max(largest_error, float(error))
    return largest_error


def simulated(arm: Arm, angles: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return the deviations of the delayed joint angles (N, 7) from rest at a pose under commands (N, 7), rad."""
    data = arm.rest(angles)
    start = data.qpos.copy()
    substeps = round(arm.description.sample_time / arm.model.opt.timestep)
    readings = np.empty_like(command)
    for k, control in enumerate(arm.controls(command)):
        # Read before the command of the same tick acts, as the recorder does.
        readings[k] = data.qpos
        data.ctrl[:] = control
        mujoco.mj_step(arm.model, data, nstep=substeps)
    return delayed(readings, arm.delays) - start


def linear(model: StateSpace, offsets: np.ndarray) -> np.ndarray:
    """Return the linear model's response (N, 7) from rest to command offsets (N, 7), rad."""
    state, response = np.zeros(model.order), np.empty((len(offsets), model.ny))
    for k, offset in enumerate(offsets):
        response[k] = model.C @ state + model.D @ offset
        state = model.A @ state + model.B @ offset
    return response

"""Work against precision of the physics: integrators and steps for each kind of drive.

It takes two minutes and writes a Markdown table for each kind:

* error of the log: a studied joint follows pseudo-random binary commands of 4 mrad for 6 s, one joint at a time,
  with LuGre friction; root mean square of the difference between its angles at 50 Hz and the reference's over that of
  its deviation from the pose, the worst of the three;
* change of bandwidth: of the small-signal arm against the reference, the worst of six joints;
* cost: processor time over that of the kind's default, both measured in turns in this run.

The reference is Richardson's extrapolation of two runs by RK4 far below the default step.
"""

from collections import namedtuple

import mujoco
import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Plant, load_arm
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import OPERATING_POSE
from tests.benchmarks.tables import heading, row, timed
from tests.hmtb_twin.altered_arms import at_step, bandwidths

KINDS = {
    "linear, flow servo": ("nominal", Plant()),
    "linear, torque servo": ("nominal", Plant(servo="torque")),
    "electric": ("flight", Plant()),
    "orifice, flow servo": ("nominal", Plant("orifice")),
}
"""Variant and plant of each kind of drive."""
INTEGRATORS = {"Euler": mujoco.mjtIntegrator.mjINT_EULER, "RK4": mujoco.mjtIntegrator.mjINT_RK4}
TICK_STEPS = {"Euler": (20, 80), "RK4": (6, 8, 12, 15, 20, 40)}  # physics steps of a tick
FINEST = 160  # physics steps of a tick of the finer of the reference's two runs
AMPLITUDE, SECONDS, TURNS = 4e-3, 6.0, 3


Result = namedtuple("Result", "logs bandwidths")


def commands():
    """Commands (N, 7) that excite one studied joint each, rad."""
    pose = load_arm().pose(OPERATING_POSE)
    ticks = round(SECONDS / SAMPLE_TIME)
    bits = np.repeat(np.random.default_rng(2).choice([-AMPLITUDE, AMPLITUDE], ticks // 5), 5)
    return [pose + np.outer(bits, np.eye(len(JOINTS))[JOINTS.index(name)]) for name in STUDIED_JOINTS]


def logged(arm, command):
    """Angles (N, 7) at the end of each tick, rad."""
    data = arm.rest(command[0])
    substeps = round(SAMPLE_TIME / arm.model.opt.timestep)
    angles = np.empty_like(command)
    for place, control in zip(angles, arm.controls(command), strict=True):
        data.ctrl[:] = control
        mujoco.mj_step(arm.model, data, nstep=substeps)
        place[:] = data.qpos
    return angles


def result(arm):
    """Logs (3, N) of the excited joints and bandwidths (6,); NaN where the simulation diverges."""
    logs = np.array([logged(arm, c)[:, JOINTS.index(name)] for c, name in zip(commands(), STUDIED_JOINTS, strict=True)])
    if not np.isfinite(logs).all() or np.abs(logs).max() > 10.0:
        return Result(np.full_like(logs, np.nan), np.full(6, np.nan))
    return Result(logs, np.array(list(bandwidths(arm).values())))


def reference(arm):
    """The limit of small steps."""
    coarse, fine = (result(at_step(arm, SAMPLE_TIME * k / FINEST, INTEGRATORS["RK4"])) for k in (2, 1))
    return Result(*(b + (b - a) / 15.0 for a, b in zip(coarse, fine, strict=True)))


def cost(arm, other):
    """Processor time of the other arm over the arm's, the least of some turns."""
    command = commands()[1]
    turns = [[timed(logged, one, command)[1] for one in (arm, other)] for _ in range(TURNS)]
    return min(b for _, b in turns) / min(a for a, _ in turns)


def table(kind):
    """Print the table of one kind of drive."""
    variant, plant = KINDS[kind]
    arm = load_arm(variant, plant=plant)
    limit = reference(arm)
    moved = np.linalg.norm(limit.logs - limit.logs[:, :1], axis=1)
    heading(f"{kind}: integrator", "steps of a tick", "error of the log", "change of bandwidth", "cost")
    default = (INTEGRATORS["RK4"], round(SAMPLE_TIME / arm.model.opt.timestep))
    for name, integrator in INTEGRATORS.items():
        for steps in TICK_STEPS[name]:
            other = at_step(arm, SAMPLE_TIME / steps, integrator)
            outcome = result(other)
            error = float((np.linalg.norm(outcome.logs - limit.logs, axis=1) / moved).max())
            changes = outcome.bandwidths / limit.bandwidths - 1.0
            worst = float(changes[np.argmax(np.abs(changes))])
            moved_by = f"{100 * worst:+.4f} %" if np.isfinite(worst) else "unstable at rest"
            label = f"**{name}**" if (integrator, steps) == default else name
            cells = ["diverges", "", ""]
            if np.isfinite(error):
                cells = [f"{error:.1e}", moved_by, f"{cost(arm, other):.2f}"]
            row(label, f"{steps}", *cells)
    print()


def main():
    # Steps too coarse diverge, as the table tells; the engine need not write that to a file.
    mujoco.set_mju_user_warning(lambda text: None)
    for name in KINDS:
        table(name)


if __name__ == "__main__":
    main()

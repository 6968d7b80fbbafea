"""Work against precision of the physics: integrators and steps for both forms of the actuator.

On a quiet machine it takes some ten minutes. It writes a Markdown table for each form:

* error of the log: a studied joint follows pseudo-random binary commands of 0.067 rad for 6 s, one joint at a time,
  with LuGre friction; root mean square of the difference between its angles at 50 Hz and the reference's over that of
  its deviation from the pose, the worst of the three;
* change of bandwidth: of the small-signal arm against the reference, the worst of six joints;
* cost: processor time over that of the form's default, both measured in turns in this run.

The reference is Richardson's extrapolation of two steps far below the default.
"""

from collections import namedtuple
from dataclasses import replace

import mujoco
import numpy as np

from hmtb_twin import JOINTS, NOMINAL_PLANT, STUDIED_JOINTS, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE, SAMPLE_TIME
from tests.benchmarks.tables import heading, row, timed
from tests.hmtb_twin.altered_arms import at_step, bandwidths

INTEGRATORS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
REFERENCE = {"linear": ("implicitfast", 1.0 / 64e3, 1), "orifice": ("RK4", 1.0 / 16e3, 4)}
"""Integrator, the coarser of the two steps in s, and the order by which their difference is extrapolated."""
AMPLITUDE, SECONDS, TURNS = 0.067, 6.0, 5


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


def reference(arm, form):
    """The limit of small steps."""
    name, step, order = REFERENCE[form]
    coarse, fine = (result(at_step(arm, s, INTEGRATORS[name])) for s in (step, step / 2.0))
    part = 1.0 / (2.0**order - 1.0)
    return Result(
        fine.logs + part * (fine.logs - coarse.logs), fine.bandwidths + part * (fine.bandwidths - coarse.bandwidths)
    )


def cost(arm, other):
    """Processor time of the other arm over the arm's, the least of some turns."""
    command = commands()[1]
    turns = [[timed(logged, one, command)[1] for one in (arm, other)] for _ in range(TURNS)]
    return min(b for _, b in turns) / min(a for a, _ in turns)


def table(form):
    """Print the table of one form of the actuator."""
    arm = load_arm(plant=replace(NOMINAL_PLANT, actuator=form))
    limit = reference(arm, form)
    moved = np.linalg.norm(limit.logs - limit.logs[:, :1], axis=1)
    heading(f"{form}: integrator", "step, ms", "error of the log", "change of bandwidth", "cost")
    default = (mujoco.mjtIntegrator(arm.model.opt.integrator), arm.model.opt.timestep)
    for name, integrator in INTEGRATORS.items():
        for step in STEPS:
            other = at_step(arm, step, integrator)
            outcome = result(other)
            error = float((np.linalg.norm(outcome.logs - limit.logs, axis=1) / moved).max())
            changes = outcome.bandwidths / limit.bandwidths - 1.0
            worst = float(changes[np.argmax(np.abs(changes))])
            moved_by = f"{100 * worst:+.4f} %" if np.isfinite(worst) else "unstable at rest"
            label = f"**{name}**" if (integrator, step) == default else name
            cells = ["diverges", "", ""]
            if np.isfinite(error):
                cells = [f"{error:.1e}", moved_by, f"{cost(arm, other):.2f}"]
            row(label, f"{1e3 * step:g}", *cells)
    print()


def main():
    # Steps too coarse diverge, as the table tells; the engine need not write that to a file.
    mujoco.set_mju_user_warning(lambda text: None)
    for name in REFERENCE:
        table(name)


if __name__ == "__main__":
    main()

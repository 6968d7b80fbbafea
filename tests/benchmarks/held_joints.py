"""Each joint's linear hydraulics, the others held: what theory says and how far the simulation at its own step is off.

Run by hand from the root of the repository: `PYTHONPATH=. python tests/benchmarks/held_joints.py` (some seconds).
"""

import importlib.util
import sys
from math import pi
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np

from hmtb_twin import JOINTS


def benches() -> ModuleType:
    """The bench stands beside the test that holds it to its bounds."""
    path = Path(__file__).parents[1] / "hmtb_twin" / "truth" / "test_analytic_hydraulics.py"
    spec = importlib.util.spec_from_file_location("benches", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules["benches"] = module
    spec.loader.exec_module(module)
    return module


def percent(found: float, expected: float) -> str:
    """Deviation in percent."""
    return f"{round(100.0 * (found / expected - 1.0), 3) + 0.0:+.3f}"


def poles(values: np.ndarray) -> str:
    """Two poles, rad/s."""
    slow, fast = values
    return f"{slow.real:.1f} ± {abs(slow.imag):.0f}i" if slow.imag else f"{slow.real:.2f}, {fast.real:.0f}"


def driven(machine: Any, flow: float) -> float:
    """Speed that a flow ends in, rad/s; seconds are many time constants of every joint."""
    return float(machine.run(np.full(round(3.0 / machine.model.opt.timestep), flow))[-1, 0])


def stalled(machine: Any, fixed: float) -> float:
    """Torque of the fully open valve on a standing joint, N m."""
    model, joint = machine.model, machine.joint
    model.dof_armature[joint] = fixed
    data = machine.start()
    data.ctrl[2 * joint + 1] = 10.0 * machine.actuator.maximum_torque
    mujoco.mj_step(model, data, nstep=1000)
    return float(data.actuator_force[joint])


def rows(module: ModuleType) -> list[str]:
    """The table's rows."""
    made = []
    for name in JOINTS:
        cells = [name.replace("_", " ")]
        machine, shut = module.bench(name), module.bench(name, valve=False)
        theory, closed = machine.theory, shut.theory
        (frequency, damping), exact = module.oscillator(module.linearized(machine)), module.oscillator(theory.poles)
        cells += [f"{theory.inertia:.3g}", poles(theory.poles), f"{theory.damping_ratio:.2f}"]
        cells += [percent(frequency, exact[0]), percent(damping, exact[1])]
        small, speed = 0.1 * theory.largest_flow, driven(machine, 5.0 * theory.largest_flow)
        cells += [percent(driven(machine, small), theory.velocity_gain * small)]
        cells += [f"{theory.no_load_speed:.3f}", percent(speed, theory.no_load_speed)]
        cells += [f"{theory.stall_torque:.1f}", percent(stalled(machine, module.FIXED), theory.stall_torque)]
        ringing = module.oscillator(module.linearized(shut, drift=1e-3))
        cells += [f"{closed.natural_frequency / (2.0 * pi):.2f}", percent(ringing[0], closed.natural_frequency)]
        cells += [f"{closed.damping_ratio:.4f}", percent(ringing[1], closed.damping_ratio)]
        made.append(f"| {' | '.join(cells)} |")
    return made


def main() -> None:
    """Write the table to standard output."""
    heads = ["joint", "J, kg m2", "poles, rad/s", "zeta_h", "frequency, %", "damping, %", "velocity gain, %"]
    heads += ["no-load speed, rad/s", "%", "stall torque, N m", "%", "closed valve: f_h, Hz", "%", "zeta_h", "%"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *rows(benches())]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

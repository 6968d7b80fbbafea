"""Linear hydraulics of each joint, the others held: theory, and how far the simulation at its own step is off."""

from math import pi

import numpy as np

from hmtb_twin import JOINTS
from tests.benchmarks.tables import heading, row
from tests.hmtb_twin.truth import test_analytic_hydraulics as benches


def percent(value, expected):
    return f"{round(100.0 * (value / expected - 1.0), 3) + 0.0:+.3f}"


def poles(values):
    slow, fast = values
    return f"{slow.real:.1f} ± {abs(slow.imag):.0f}i" if slow.imag else f"{slow.real:.2f}, {fast.real:.0f}"


def driven(machine, flow):
    """Speed that a flow ends in, rad/s; seconds are many time constants of every joint."""
    return float(machine.run(np.full(round(3.0 / machine.model.opt.timestep), flow))[-1, 0])


LIMITS = ("no-load speed, rad/s", "%", "stall torque, N m", "%", "closed valve: f_h, Hz", "%", "zeta_h", "%")


def main():
    heading("joint", "J, kg m2", "poles, rad/s", "zeta_h", "frequency, %", "damping, %", "velocity gain, %", *LIMITS)
    for name in JOINTS:
        cells = [name.replace("_", " ")]
        machine, shut = benches.bench(name), benches.bench(name, valve=False)
        theory, closed = machine.theory, shut.theory
        (frequency, damping), exact = benches.oscillator(benches.linearized(machine)), benches.oscillator(theory.poles)
        cells += [f"{theory.inertia:.3g}", poles(theory.poles), f"{theory.damping_ratio:.2f}"]
        cells += [percent(frequency, exact[0]), percent(damping, exact[1])]
        small, speed = 0.1 * theory.largest_flow, driven(machine, 5.0 * theory.largest_flow)
        cells += [percent(driven(machine, small), theory.velocity_gain * small)]
        cells += [f"{theory.no_load_speed:.3f}", percent(speed, theory.no_load_speed)]
        cells += [f"{theory.stall_torque:.1f}", percent(machine.stall_torque(), theory.stall_torque)]
        ringing = benches.oscillator(benches.linearized(shut))
        cells += [f"{closed.natural_frequency / (2.0 * pi):.2f}", percent(ringing[0], closed.natural_frequency)]
        cells += [f"{closed.damping_ratio:.4f}", percent(ringing[1], closed.damping_ratio)]
        row(*cells)


if __name__ == "__main__":
    main()

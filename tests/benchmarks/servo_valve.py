"""The servo valves' loops, and the truth of an arm that has them.

It takes a minute and writes Markdown tables: margins of each load-pressure loop and damping of the whole arm with
other amplifiers and spools, with torque servos; damping over supply pressures with both servo laws; bandwidths beside
those of linear actuators; the tangent's error by amplitude; the cost of the compiler, in a process of its own, with an
empty cache and a full one.
"""

import os
import subprocess
import sys
import tempfile
from copy import copy
from dataclasses import replace
from itertools import product

import numpy as np

from hmtb_twin import JOINTS, OverloadError, Plant, linearize, load_arm
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.parameters.servo_valve import SERVO_VALVE
from hmtb_twin.parameters.variants import INDEXED_JOINTS, OPERATING_POSE, PAYLOADS
from tests.benchmarks.tables import heading, row
from tests.hmtb_twin.altered_arms import natural_poles, with_valve

POSES = (OPERATING_POSE, "home")
AMPLITUDES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
VALVES = {
    "as it is": SERVO_VALVE,
    "loop gain 180 rad/s": replace(SERVO_VALVE, loop_gain=180.0),
    "spool 40 Hz": replace(SERVO_VALVE, frequency=40.0),
    "spool 100 Hz": replace(SERVO_VALVE, frequency=100.0),
}
OIL = SERVO_VALVE.frequency
"""Frequency above which only light joints on their oil ring, faster than the spool can damp, Hz."""
START = """
import time
start = time.perf_counter()
from hmtb_twin.hydraulics.callbacks import install_equations
imported = time.perf_counter()
install_equations()
print(imported - start, time.perf_counter() - imported)
"""


def oscillations(poles):
    """Damping ratios of those poles that swing, and one of each pair."""
    swinging = poles[poles.imag > 1.0]
    return -swinging.real / np.abs(swinging), swinging


def over_pressure(law, pressure):
    """Whether the arms are stable and damped on a supply: the worst of all variants, payloads, poses, temperatures."""
    held, slowest, damping, oil = 0, -np.inf, np.inf, np.inf
    cases = list(product(("nominal", "published"), PAYLOADS, POSES, (0.0, 40.0, 100.0)))
    for variant, payload, pose, temperature in cases:
        plant = Plant("orifice", law, "viscous", supply_pressure=pressure, oil_temperature=temperature)
        try:
            poles = natural_poles(load_arm(variant, payload, plant=plant), pose)
        except OverloadError:
            continue
        ratios, swinging = oscillations(poles)
        ringing = np.abs(swinging) > 2.0 * np.pi * OIL
        held, slowest = held + 1, max(slowest, poles.real.max())
        damping, oil = min([damping, *ratios[~ringing]]), min([oil, *ratios[ringing]])
    return law, f"{pressure:g}", f"{held} of {len(cases)}", f"{slowest:.2f}", f"{damping:.2f}", f"{oil:.2f}"


def least_damped(arm, pose):
    """Frequency and damping of the arm's two least damped oscillations."""
    damping, swinging = oscillations(natural_poles(arm, pose))
    order = np.argsort(damping)[:2]
    return ", ".join(f"{damping[k]:+.2f} at {abs(swinging[k]) / (2 * np.pi):.1f} Hz" for k in order)


def plain_loop(arm, gain):
    """The arm with the same gain for standing and for changing loads, rad/s."""
    model = copy(arm.model)
    compliance = [arm.actuators[name].compliance for name in JOINTS]
    model.actuator_user[0::2, [eq.PRESSURE_GAIN, eq.DYNAMIC_GAIN]] = np.outer(compliance, [gain, 0.0])
    return replace(arm, model=model)


def table(*lines):
    heading(*map(str, lines[0]))
    for line in lines[1:]:
        row(*line)
    print()


def start(folder):
    """Seconds to import the compiler and to have the equations compiled or read back, in a process of its own."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
    return map(float, subprocess.check_output([sys.executable, "-c", START], env=environment).split())


def main():
    arm = load_arm(plant=Plant("orifice", "torque"), friction=False)
    loops = []
    for name in JOINTS:
        static = SERVO_VALVE.static_gain(arm.actuators[name], arm.gains[name].kd)
        gain, phase = SERVO_VALVE.margins(static)
        loops.append((name.replace("_", " "), f"{static:.0f}", f"{SERVO_VALVE.loop_gain:.0f}", f"{gain:.1f}"))
        loops[-1] += (f"{np.degrees(phase):.0f}",)
    table(("joint", "standing load, rad/s", "changing load, rad/s", "gain margin", "phase margin, deg"), *loops)

    arms = {what: with_valve(arm, valve=valve) for what, valve in VALVES.items()}
    arms |= {f"{gain:.0f} rad/s for standing loads too": plain_loop(arm, gain) for gain in (120.0, 180.0)}
    rows = [(what, *(least_damped(one, pose) for pose in POSES)) for what, one in arms.items()]
    table(("valve", *(f"least damped, {pose}" for pose in POSES)), *rows)

    table(
        ("servo", "supply, MPa", "cases held", "slowest pole, rad/s", f"least damping below {OIL:g} Hz", "above"),
        *(over_pressure(law, pressure) for law in ("flow", "torque") for pressure in (10.0, 20.7, 35.0)),
    )

    arm, plain = (load_arm(plant=Plant(actuator=form), friction=False) for form in ("orifice", "linear"))
    truths = [linearize(arm, pose, amplitudes=AMPLITUDES) for pose in POSES]
    straight = [linearize(plain, pose, amplitudes=()) for pose in POSES]
    rows = []
    for name in JOINTS:
        if name not in INDEXED_JOINTS:
            cells = []
            for truth, line in zip(truths, straight, strict=True):
                joint = truth.joint(name)
                cells += [f"{joint.bandwidth_hz:.3f} ({line.joint(name).bandwidth_hz:.3f})", f"{joint.dc_gain:.4f}"]
            rows.append((name.replace("_", " "), *cells))
    header = [cell for pose in POSES for cell in (f"bandwidth, {pose} (linear), Hz", "gain at 0 Hz")]
    table(("joint", *header), *rows)

    errors = [
        (pose, *(f"{truth.small_signal_error[a]:.1e}" for a in AMPLITUDES))
        for pose, truth in zip(POSES, truths, strict=True)
    ]
    table(("error of the tangent", *(f"{a:.0e} rad" for a in AMPLITUDES)), *errors)

    with tempfile.TemporaryDirectory() as folder:
        times = [(what, *(f"{t:.1f}" for t in start(folder))) for what in ("empty", "full")]
    table(("cache", "import of the compiler, s", "equations, s"), *times)


if __name__ == "__main__":
    main()

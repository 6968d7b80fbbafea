"""What the arm does in every test, and whether it stays within limits: a table of whole-length simulations.

Run with names or tags of scenarios. Rates and ways are those of the arm itself, commands beside them in brackets.
"""

import sys

import numpy as np

from hmtb_twin import JOINTS, Status, load_arm, simulate
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios import load, names
from scenarios.experiments.joint_inputs import settled_inputs
from tests.benchmarks.tables import heading, options, row
from tests.hmtb_twin.altered_arms import LOWER, UPPER

HEAD = (
    "test",
    "peak joint rate, deg/s",
    "tool moves up to, mm",
    "tool turns up to, mrad",
    "converters clip, %",
    "at velocity limit, %",
    "order of excitation",
    "condition between joints",
    "within limits",
)


def main():
    parser = options(__doc__)
    parser.add_argument("names", nargs="+", help="scenarios, or tags of them")
    chosen = [
        load(name) for entry in parser.parse_args().names for name in ((entry,) if entry in names() else names(entry))
    ]
    result = simulate(chosen)
    logs = {log.name: log for log in result.logs}
    heading(*HEAD)
    for scenario in chosen:
        if scenario.name in logs:
            row(*_row(scenario, logs[scenario.name]))
        else:
            row(scenario.name, f"failed: {result.failed[scenario.name]}", *("" for _ in HEAD[2:]))
    return 1 if result.failed else 0


def _row(scenario, log):
    arm = load_arm(scenario.variant, scenario.payload, worksite=scenario.worksite)
    rates = np.abs(np.diff(log.true_angles, axis=0)) / SAMPLE_TIME
    asked = np.abs(np.diff(log.commanded, axis=0)) / SAMPLE_TIME
    fastest = int((rates.max(axis=0) / arm.velocity_limits).argmax())
    home, frame = arm.controller.tool_pose(arm.pose(scenario.pose))
    ways, turns = [], []
    for angles in (log.true_angles, log.commanded):
        places, rotations = arm.controller.tool_path(angles)
        ways.append(np.linalg.norm(places - home, axis=1).max())
        turned = np.linalg.norm(rotations - frame, axis=(1, 2)).max() / np.sqrt(8.0)
        turns.append(2.0 * np.arcsin(min(turned, 1.0)))
    beyond = BOARD.exceeds_range(scenario.requested_volts()).any(axis=1)
    clipped = float(np.mean(beyond | ((log.status & Status.CONVERTER_SATURATED) != 0)))
    orders = ", ".join(str(entry.waveform().order_of_excitation()) for entry in scenario.excitation) or "-"
    inputs = settled_inputs(log.commanded, scenario)
    limits = arm.velocity_limits
    complaints = {
        "commands beyond their velocity limits": (asked > limits * (1 + 1e-9)).any(),
        "joints faster than their limits": (rates > limits).any(),
        "commands beyond ranges": ((log.commanded < LOWER) | (log.commanded > UPPER)).any(),
        "joints beyond ranges": ((log.true_angles < LOWER) | (log.true_angles > UPPER)).any(),
        "a joint at the end of its range": (log.status & Status.JOINT_LIMITED).any(),
        "near singular": (log.status & Status.SINGULAR).any(),
        "a converter clips": clipped > 0,
    }
    limit = np.degrees(arm.velocity_limits[fastest])
    return (
        scenario.name,
        f"{JOINTS[fastest].replace('_', ' ')} {np.degrees(rates.max(axis=0)[fastest]):.1f} "
        f"({np.degrees(asked.max(axis=0)[fastest]):.1f} of {limit:.0f})",
        f"{1e3 * ways[0]:.1f} ({1e3 * ways[1]:.1f})",
        f"{1e3 * turns[0]:.1f} ({1e3 * turns[1]:.1f})",
        f"{100 * clipped:.3g}",
        f"{100 * np.mean((log.status & Status.VELOCITY_LIMITED) != 0):.3g}",
        orders,
        "" if inputs is None else f"{inputs.condition:.3g}",
        "no: " + ", ".join(name for name, holds in complaints.items() if holds) if any(complaints.values()) else "yes",
    )


if __name__ == "__main__":
    sys.exit(main())

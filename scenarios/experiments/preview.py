"""Preview of the commands of an experiment before the arm moves [Morris1996, sec. II.3]."""

from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from hmtb_twin import Status, load_arm
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.run.experiment_row import prepare
from scenarios.experiments.excitation_computer import MISSES_POINTS
from scenarios.experiments.joint_inputs import STILL, JointInputs, settled_inputs
from scenarios.experiments.model_structures import excitation_order_warning, needed_orders
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.result_table import ResultTable


def deadband_warning(scenario: Scenario) -> str | None:
    """Return one line if the excitation stays within the deadband or one count, so that nothing moves; else None."""
    if not scenario.excitation or scenario.has_own_operator:
        return None
    reach, interface = float(np.abs(scenario.volts()).max()), scenario.hand_controller
    if interface.deadband > 0.0 and reach <= interface.deadband:
        extent = f"within the deadband of {interface.deadband:g} V"
    elif scenario.chain.adc and reach <= interface.adc_step:
        extent = f"by no more than one count of {1e3 * interface.adc_step:.3g} mV"
    else:
        return None
    return f"the excitation moves the stick {extent}: no joint is commanded to move, but for noise and bias"


@dataclass(frozen=True, eq=False)
class Preview:
    """Commands that an experiment will give.

    Attributes:
        scenario: The experiment; N is its length, or that up to its first emergency shutdown.
        requested: Voltages that the files request of the excitation computer's converter (N, n_axes), V.
        volts: Voltage at the hand-controller converter, with bias and noise (N, n_axes), V.
        commands: Joint commands (N, 7), rad, as a simulation of the experiment logs them.
        tool: Commanded displacement of the tool from its start, in its frame there (N, 3), m.
        turn: Largest commanded rotation of the tool, rad.
        status: What was limited at each tick, bits of `Status` (N,).
        velocity_limits: Velocity limit of each joint's command (7,), rad/s.
        inputs: Independence of the commands of several joints; None if the experiment moves only one.
        power_off: First emergency shutdown, s; None without one.
    """

    scenario: Scenario
    requested: np.ndarray
    volts: np.ndarray
    commands: np.ndarray
    tool: np.ndarray
    turn: float
    status: np.ndarray
    velocity_limits: np.ndarray
    inputs: JointInputs | None
    power_off: float | None = None

    @property
    def duration(self) -> float:
        """Length of the preview, s."""
        return len(self.commands) * self.scenario.arm.sample_time

    @property
    def rates(self) -> np.ndarray:
        """Rates of the commands (N - 1, 7), rad/s."""
        return np.diff(self.commands, axis=0) / self.scenario.arm.sample_time

    @property
    def moving(self) -> tuple[str, ...]:
        """Joints that the commands move by more than rounding."""
        ranges = zip(self.scenario.arm.joints, np.ptp(self.commands, axis=0), strict=True)
        return tuple(joint for joint, reach in ranges if reach > STILL)

    def column(self, joint: str) -> int:
        """Return the column of a joint in the commands."""
        return self.scenario.arm.joint_index(joint)

    def peak_rate(self, joint: str) -> float:
        """Return the largest rate of a joint's command, rad/s."""
        return float(np.abs(self.rates[:, self.column(joint)]).max(initial=0.0))

    def margin(self, joint: str) -> float:
        """Return the smallest distance of a joint's command from the ends of its range, rad."""
        command, motion = self.commands[:, self.column(joint)], self.scenario.arm.motions[joint]
        return float(min(command.min() - motion.lower, motion.upper - command.max()))

    def share(self, flag: Status) -> float:
        """Return the fraction of ticks with a flag."""
        return float(np.mean((self.status & flag) != 0))

    @property
    def velocity_limited(self) -> float:
        """Fraction of ticks at which a joint's command moves at its velocity limit."""
        return self.share(Status.VELOCITY_LIMITED)

    @property
    def dac_clipped(self) -> float:
        """Fraction of samples beyond the range of the excitation computer's converter."""
        return float(np.mean(BOARD.exceeds_range(self.requested)))

    @property
    def deflection(self) -> float:
        """Largest distance of the tool from its start, m."""
        return float(np.linalg.norm(self.tool, axis=1).max())

    @property
    def orders(self) -> tuple[int, ...]:
        """Order of persistent excitation of each file."""
        return tuple(signal.waveform().order_of_excitation() for signal in self.scenario.excitation)

    def table(self) -> ResultTable:
        """Return for each moving joint its peak rate, velocity limit and distance from the range's end."""
        length = f"{self.duration:g} s"
        if self.duration < self.scenario.duration:
            length += f" of {self.scenario.duration:g} s"
        mode, axes = self.scenario.mode.replace("_", " "), ", ".join(self.scenario.axes)
        rows = []
        for joint in self.moving:
            peak_rate = f"{degrees(self.peak_rate(joint)):.1f} deg/s"
            limit = f"{degrees(self.velocity_limits[self.column(joint)]):.1f} deg/s"
            rows.append((joint, peak_rate, limit, f"{degrees(self.margin(joint)):.1f} deg"))
        columns = ("joint", "peak rate", "limit", "distance from the range's end")
        return ResultTable(f"{self.scenario.name}: {length}, {mode} mode, axes {axes}", columns, rows)

    def record(self) -> dict[str, object]:
        """Return what `hmtb preview --json` prints of the experiment."""
        joints = {}
        for joint in self.moving:
            joints[joint] = {
                "peak_rate_rad_s": self.peak_rate(joint),
                "velocity_limit_rad_s": self.velocity_limits[self.column(joint)],
                "range_margin_rad": self.margin(joint),
            }
        return {
            "duration_s": self.duration,
            "power_off_s": self.power_off,
            "joints": joints,
            "tool_deflection_m": self.deflection,
            "tool_turn_rad": self.turn,
            "velocity_limited": self.velocity_limited,
            "joint_limited": self.share(Status.JOINT_LIMITED),
            "singular": self.share(Status.SINGULAR),
            "clipped": {"dac": self.dac_clipped, "adc": self.share(Status.CONVERTER_SATURATED)},
            "order_of_excitation": self.orders,
            "needed_order": needed_orders(),
            "inputs": self.inputs.summary() if self.inputs else None,
            "warnings": self.warnings(),
        }

    def lines(self) -> list[str]:
        """Return the rest of the preview in words."""
        adc_clipped = self.share(Status.CONVERTER_SATURATED)
        lines = [
            f"tool: up to {1000 * self.deflection:.1f} mm and {degrees(self.turn):.3f} deg from its start",
            f"command rate-limited: {100 * self.velocity_limited:.3g} % of the time",
            f"clipped: {100 * self.dac_clipped:.3g} % by the excitation computer's converter, "
            f"{100 * adc_clipped:.3g} % by the hand controller's",
            f"order of excitation: {', '.join(map(str, self.orders))}",
        ]
        if self.inputs is not None:
            names = ", ".join(self.inputs.names)
            lines.append(f"condition between the commands of {names}: {self.inputs.condition:.3g}")
        return lines

    def warnings(self) -> tuple[str, ...]:
        """Return what the operator should know before the arm moves, one line each."""
        warnings = []
        if self.power_off is not None:
            warnings.append(
                f"power off at {self.power_off:g} s: commands from then on depend on the arm and are not previewed"
            )
        if (deadband := deadband_warning(self.scenario)) is not None:
            warnings.append(deadband)
        for flag, meaning in (
            (Status.JOINT_LIMITED, "of the ticks a joint stands at an end of its range"),
            (Status.SINGULAR, "of the ticks the tool lags because the pose is near singular"),
            (Status.CONVERTER_SATURATED, "of the ticks the hand controller's converter stands at an end of its range"),
        ):
            if share := self.share(flag):
                warnings.append(f"{100 * share:.3g} % {meaning}")
        if self.dac_clipped:
            warnings.append(
                f"{100 * self.dac_clipped:.3g} % of the samples ask for more than the ±{BOARD.dac_range:g} V of the "
                "excitation computer's converter"
            )
        if any(signal.misses_points for signal in self.scenario.excitation):
            warnings.append(MISSES_POINTS)
        # Axes that play the same file have the same warning: it is given once.
        order_warnings = dict.fromkeys(map(excitation_order_warning, self.orders))
        warnings += [warning for warning in order_warnings if warning]
        if self.inputs is not None and (independence := self.inputs.warning()):
            warnings.append(independence)
        return tuple(warnings)


def preview(scenario: Scenario) -> Preview:
    """Compute the commands of an experiment without physics, equal to the bit, up to its first emergency shutdown.

    Raises:
        ScenarioError: An operator moves the stick: the commands depend on the arm and cannot be known beforehand.
        TwinError: The laboratory lacks something that the experiment needs.
    """
    if scenario.operator() is not None:
        raise ScenarioError(
            f"{scenario.name}: an operator who looks at the arm moves the stick; expected an excitation; to see what "
            f"the operator does: hmtb simulate {scenario.name}"
        )
    # As a simulation prepares it, so that bias and noise are those that it will have.
    row = prepare(scenario, load_arm)
    arm, station = row.arm, row.station
    ticks, power_off = station.ticks, None
    if scenario.shutdown:
        # Before the first shutdown the commands are those without it; its times were checked above.
        # At least one sample, where the power is off from the beginning.
        ticks, power_off = max(1, int(station.powered.argmin())), scenario.shutdown[0]
        station = prepare(replace(scenario, shutdown=()), load_arm).station
    commands = station.commands[:ticks]
    positions, rotations = arm.controller.tool_path(commands)
    home, frame = arm.controller.tool_pose(arm.pose(scenario.pose))
    # Trace of a rotation by an angle: 1 + 2 cos; small angles need the sine, |R - R0| = 2 sqrt(2) sin(angle / 2).
    turned = np.linalg.norm(rotations - frame, axis=(1, 2)).max() / np.sqrt(8.0)
    return Preview(
        scenario=scenario,
        requested=scenario.requested_volts()[:ticks],
        volts=station.volts[:ticks],
        commands=commands,
        tool=(positions - home) @ frame,
        turn=float(2.0 * np.arcsin(min(turned, 1.0))),
        status=station.status[:ticks],
        velocity_limits=arm.velocity_limits,
        inputs=settled_inputs(commands, scenario),
        power_off=power_off,
    )

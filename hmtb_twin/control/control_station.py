"""Control station of one experiment: from the stick to the joint command, tick by tick."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.control.experiment import Experiment, JointController, Motion, Status, View
from hmtb_twin.control.hand_controller import HandControllerInterface, deflection, pickup
from hmtb_twin.control.joint_loop import JointLoop
from hmtb_twin.control.modes import axis_gains, start_mode
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.values import SAMPLE_RATE


class ControlStation:
    """Excitation computer or operator, hand controller, control mode, joint controller and emergency shutdown.

    Commands that depend only on the excitation are computed at once. Those of an operator or of a joint controller, who
    see the arm, and of an experiment with an emergency shutdown, after which the command starts where the arm stands,
    are computed tick by tick, with the same arithmetic to the bit.

    Args:
        experiment: The experiment.
        arm: The arm as its controller knows it.
        rng: Source of bias, noise and hum.
        live: Whether commands are computed tick by tick although they depend only on the excitation.

    Attributes:
        ticks: Length N of the experiment.
        volts: Voltage at the converter (N, n_axes), V.
        counts: Converter counts after sample and hold (N, n_axes).
        commands: Joint commands (N, 7), rad.
        loop: The joint controller between mode and arm; None without one.
        status: What was limited at each tick, bits of `Status` (N,).
        powered: Whether the servos have power at each tick (N,).
        exchanges: Number of payload changes up to each tick (N,).
        operator: Operator; None if the excitation computer moves the stick.
        live: Whether commands are computed tick by tick.
        grip: Whether the operator has the end effector closed; None without an operator.

    Raises:
        TwinError: The experiment needs something that the station does not have.
    """

    def __init__(self, experiment: Experiment, arm: Arm, rng: np.random.Generator, *, live: bool = False) -> None:
        rate = arm.description.sample_rate
        self.ticks = _ticks(experiment, rate)
        self._mode = start_mode(experiment, arm)
        self._parameters = experiment.hand_controller
        self._gains = axis_gains(experiment.mode, experiment.axes, self._parameters)
        self.operator = experiment.operator()
        if self.operator is not None and not callable(getattr(self.operator, "move", None)):
            raise TwinError(
                f"{experiment.name}: operator() gave {type(self.operator).__name__}, expected an object with a method "
                "move(view), or None"
            )
        axes = len(experiment.axes)
        tick = arm.description.sample_time
        disturbance = pickup(self.ticks, axes, self._parameters, rng, experiment.chain, tick)
        self._interface = HandControllerInterface(self._parameters, experiment.chain, disturbance)
        self.powered = servo_power(experiment.shutdown, self.ticks, rate)
        self.exchanges = payload_exchanges(experiment, self.ticks, rate)
        self.loop = _joint_loop(experiment, arm, self.ticks)
        self.live = live or self.operator is not None or self.loop is not None or not self.powered.all()
        self.commands = np.empty((self.ticks, len(arm.joints)))
        self.status = np.zeros(self.ticks, dtype=np.int64)
        self.grip: bool | None = None
        if self.operator is None:
            self._excitation = _excitation(experiment, self.ticks, rate)
            self.volts, self.counts = self._interface.read(self._excitation)
        else:
            self.volts, self.counts = np.empty((2, self.ticks, axes))
        if not self.live:
            # The same steps as tick by tick, for all ticks at once.
            deflections = self._gains * deflection(self.counts, self._parameters)
            for tick in range(self.ticks):
                self.commands[tick], self.status[tick] = self._mode.step(deflections[tick])
            self._flag_saturation(slice(None))

    def tick(self, tick: int, reading: np.ndarray, look: Callable[[], View]) -> None:
        """Compute the command of one tick of a live station.

        Args:
            tick: The tick.
            reading: Resolver readings at this tick (7,), rad.
            look: Returns the operator's view.

        Raises:
            TwinError: The operator returns an invalid motion.
        """
        if self.operator is not None:
            motion = self.operator.move(look())
            self.grip = motion.grip if isinstance(motion, Motion) else None
            volts = _checked_volts(motion, self.volts.shape[1])
            self.volts[tick] = self._interface.receive(volts[None], tick)[0]
            # The converter has sampled the voltage at the first tick of its hold.
            self.counts[tick] = self._interface.convert(self.volts[tick - tick % self._interface.hold])
        deflections = self._gains * deflection(self.counts[tick], self._parameters)
        if not self.powered[tick]:
            self.commands[tick], self.status[tick] = self._mode.rebase(reading, deflections)
            self.status[tick] |= Status.SHUT_DOWN
        elif tick > 0 and not self.powered[tick - 1]:
            # At the reset the arm stays where it stands, whatever the stick says.
            self.commands[tick], self.status[tick] = self._mode.rebase(reading, deflections)
        else:
            self.commands[tick], self.status[tick] = self._mode.step(deflections)
        if self.loop is not None:
            running = self.powered[max(tick - 1, 0)] and self.powered[tick]
            self.commands[tick], limits = self.loop.step(tick, self.commands[tick], reading, running=running)
            self.status[tick] |= limits
        self._flag_saturation(slice(tick, tick + 1))

    def _flag_saturation(self, ticks: slice) -> None:
        counts, limit = self.counts[ticks], self._parameters.adc_limit
        # Two's complement: the upper end of the range is one count short.
        saturated = ((counts <= -limit) | (counts >= limit - 1)).any(axis=1)
        self.status[ticks][saturated] |= Status.CONVERTER_SATURATED


def _joint_loop(experiment: Experiment, arm: Arm, ticks: int) -> JointLoop | None:
    """Return the loop about an experiment's joint controller, if it has one."""
    make = getattr(experiment, "controller", None)
    # The method is optional: most experiments have no joint controller.
    controller: JointController | None = make() if callable(make) else None
    if controller is None:
        return None
    for method in ("restart", "command"):
        if not callable(getattr(controller, method, None)):
            raise TwinError(
                f"{experiment.name}: controller() gave {type(controller).__name__}, expected an object with the "
                "methods restart(command) and command(requested, measured, sent), or None"
            )
    limited = experiment.chain.velocity_limit
    return JointLoop(controller, arm, arm.pose(experiment.pose), ticks, velocity_limit=limited)


def _checked_volts(motion: object, axes: int) -> np.ndarray:
    """Return the volts (n_axes,) of an operator's motion; raises `TwinError` for anything else."""
    if not isinstance(motion, Motion):
        raise TwinError(f"its operator gave {type(motion).__name__}, expected a Motion")
    try:
        volts = np.asarray(motion.volts, dtype=float)
    except (TypeError, ValueError) as error:
        raise TwinError(f"its operator gave volts {motion.volts!r}, expected {axes} numbers") from error
    if volts.shape != (axes,) or not np.isfinite(volts).all():
        raise TwinError(f"its operator gave volts {volts}, expected {axes} finite numbers, one per axis")
    return volts


def _ticks(experiment: Experiment, rate: int) -> int:
    """Return the length of an experiment in ticks; raises `TwinError` unless it is a whole number."""
    ticks = round(experiment.duration * rate)
    # Multiples of a tick are multiples only up to rounding.
    if ticks < 1 or abs(ticks - experiment.duration * rate) > 1e-9 * ticks:
        raise TwinError(
            f"{experiment.name}: duration {experiment.duration:g} s given, expected a positive multiple of "
            f"{1.0 / rate:g} s"
        )
    return ticks


def _excitation(experiment: Experiment, ticks: int, rate: int) -> np.ndarray:
    """Return the excitation computer's output (N, n_axes), V; raises `TwinError` if it does not fit the experiment."""
    volts = np.asarray(experiment.volts(), dtype=float)
    if volts.shape != (ticks, len(experiment.axes)) or not np.isfinite(volts).all():
        raise TwinError(
            f"{experiment.name}: volts of shape {volts.shape} given, expected finite values of shape "
            f"{(ticks, len(experiment.axes))} for {experiment.duration:g} s at {rate} Hz"
        )
    return volts


def servo_power(shutdown: Sequence[float], ticks: int, rate: int = SAMPLE_RATE) -> np.ndarray:
    """Return whether the servos have power at each tick; the shutdown times in s alternate between off and on.

    Raises:
        TwinError: They do not ascend between the first tick and the last.
    """
    return _event_counts("shutdown", shutdown, ticks, rate, ": power off, power on, ...") % 2 == 0


def payload_exchanges(experiment: Experiment, ticks: int, rate: int = SAMPLE_RATE) -> np.ndarray:
    """Return the number of payload changes up to each tick (ticks,) of an experiment.

    Raises:
        TwinError: Their times do not ascend between the first tick and the last, a payload follows itself, or the arm
            stands at the worksite.
    """
    changes = experiment.payload_changes
    payloads = [experiment.payload, *(change.payload for change in changes)]
    if changes and experiment.worksite:
        raise TwinError("payload_changes at the worksite given, expected none: there the operator takes the unit")
    for before, after in pairwise(payloads):
        if before == after:
            raise TwinError(f"payload_changes from {' to '.join(payloads)} given: {after} follows itself")
    return _event_counts("payload_changes at", [change.time for change in changes], ticks, rate)


def _event_counts(name: str, times: Sequence[float], ticks: int, rate: int, hint: str = "") -> np.ndarray:
    """Return the number of events up to each tick (ticks,); raises `TwinError` unless their times in s ascend."""
    seconds = np.asarray(times, dtype=float)
    # Times that are huge or not finite would become ticks without meaning: they fail the check below.
    event_ticks = np.rint(seconds * rate) if (np.abs(seconds) < ticks).all() else np.zeros(1)
    ascending = (np.diff(event_ticks) > 0).all()
    if not (ascending and (event_ticks >= 1).all() and (event_ticks < ticks).all()):
        listed = ", ".join(f"{time:g}" for time in seconds)
        raise TwinError(
            f"{name} {listed} s given, expected ascending times "
            f"between 0 and the end at {ticks / rate:g} s, {1.0 / rate:g} s apart{hint}"
        )
    return np.searchsorted(event_ticks, np.arange(ticks), side="right")

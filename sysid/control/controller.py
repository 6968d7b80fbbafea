"""Linear controllers that know which command was applied: limits and delays cannot wind them up."""

from dataclasses import dataclass

import numpy as np

from sysid.models.state_space import StateSpace
from sysid.records.arguments import sampling_interval
from sysid.records.arrays import FloatArray, Locked, lock, real_array, rectangular
from sysid.records.errors import SysidError
from sysid.records.singular_values import singular_values

GRID = 120
"""Frequencies at which the sensitivity is computed."""


@dataclass(frozen=True, eq=False)
class Controller(Locked):
    """Controller u(t) = C x(t) + Dr r(t) + Dy y(t), x(t+1) = A x(t) + Br r(t) + By y(t) + Bu ua(t).

    r is the operator's request, y the measurement, u the command and ua the command that was applied at the same
    sample: u within the limits of rate and range. An observer inside therefore stays right while the command is
    limited, which is anti-windup by construction [AstromWittenmark1997, sec. 9.4].

    Attributes:
        A: State matrix (n, n).
        Br: From the requests (n, m).
        By: From the measurements (n, m).
        Bu: From the applied commands (n, m).
        C: From the state to the commands (m, n).
        Dr: From the requests to the commands (m, m).
        Dy: From the measurements to the commands (m, m).
        dt: Sampling interval, s.
        feedforward: The part of [C, Dr] that is feedforward (m, n + m).
        correction: Largest differences between commands and feedforward (m,): they bound with which force feedback
            presses against an obstacle; None for no bound. Beyond it the loop has no integral action.

    Raises:
        SysidError: Matrices of incompatible shapes, or not finite, or a correction without feedforward.
    """

    A: FloatArray
    Br: FloatArray
    By: FloatArray
    Bu: FloatArray
    C: FloatArray
    Dr: FloatArray
    Dy: FloatArray
    dt: float
    feedforward: FloatArray | None = None
    correction: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check and lock."""
        for name in ("A", "Dr"):
            rectangular(name, getattr(self, name))
        n, m = len(np.atleast_2d(self.A)), len(np.atleast_2d(self.Dr))
        shapes: dict[str, tuple[int, ...]] = {"A": (n, n), "C": (m, n)}
        shapes |= {"Dr": (m, m), "Dy": (m, m), "Br": (n, m), "By": (n, m), "Bu": (n, m)}
        if self.correction is not None or self.feedforward is not None:
            shapes["feedforward"] = (m, n + m)
        if self.correction is not None:
            shapes["correction"] = (m,)
        for name, shape in shapes.items():
            matrix = real_array(name, getattr(self, name))
            if matrix.shape != shape:
                raise SysidError(f"{name}: expected shape {shape} for {n} states and {m} loops, got {matrix.shape}")
            object.__setattr__(self, name, lock(matrix))
        object.__setattr__(self, "dt", sampling_interval(self.dt))
        if self.correction is not None and self.correction.min() <= 0.0:
            raise SysidError(f"correction: expected values above 0, got {self.correction.min():g}")

    @property
    def loops(self) -> int:
        """Number of commands, and of measurements."""
        return len(self.Dr)

    def start(self) -> "ControllerRun":
        """Return the controller at rest: all signals are deviations from the operating point."""
        return ControllerRun(self)

    def closed_loop(self, plant: StateSpace) -> StateSpace:
        """Return the loop with a plant, within all limits.

        Args:
            plant: Model from the commands to the measurements, without direct term.

        Returns:
            Model from requests, and disturbances at the plant's input (2 m), to measurements and commands (2 m).

        Raises:
            SysidError: Another number of inputs or outputs, a direct term, or another sampling interval.
        """
        check_model("plant", plant, self.loops, self.dt, stable=False)
        # each signal as a matrix that gives it from the states of plant and controller
        of_plant, of_controller = np.split(np.eye(plant.order + len(self.A)), [plant.order])
        measured, zero = plant.C @ of_plant, np.zeros_like(self.Dr)
        command = self.C @ of_controller + self.Dy @ measured
        next_of_plant = plant.A @ of_plant + plant.B @ command
        # within all limits the applied command is the command; disturbances join it behind the controller
        next_of_controller = self.A @ of_controller + self.By @ measured + self.Bu @ command
        B = np.block([[plant.B @ self.Dr, plant.B], [self.Br + self.Bu @ self.Dr, 0.0 * self.Bu]])
        C, D = np.vstack([measured, command]), np.block([[zero, zero], [self.Dr, zero]])
        return StateSpace(np.vstack([next_of_plant, next_of_controller]), B, C, D, None, self.dt)

    def sensitivity(self, plant: StateSpace) -> float:
        """Return the largest singular value over frequency of the sensitivity at a plant's input, of a stable loop."""
        check_model("plant", plant, self.loops, self.dt, stable=False)
        # of the loop opened behind the command, which the controller takes as applied
        A, B = self.A + self.Bu @ self.C, self.By + self.Bu @ self.Dy
        f_hz = np.geomspace(1e-3, 0.5, GRID) / self.dt
        feedback = StateSpace(A, B, self.C, self.Dy, None, self.dt).frequency_response(f_hz)
        differences = np.eye(self.loops) - feedback @ plant.frequency_response(f_hz)
        # the largest singular value of the inverse, (I - feedback plant)^-1
        return float(1.0 / singular_values(differences)[:, -1].min())


class ControllerRun:
    """A controller at work, sample by sample; see `Controller`."""

    def __init__(self, controller: Controller) -> None:
        self._law = controller
        self._state = np.zeros(len(controller.A))
        # the next state without the part of the applied command, which is told later
        self._next = np.zeros(len(controller.A))

    def command(self, requested: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """Return the command u(t) (m,) for the request (m,) and the measurement (m,) of this sample.

        Raises:
            SysidError: A request or a measurement that is not finite: the state would never recover.
        """
        if not (np.isfinite(requested).all() and np.isfinite(measured).all()):
            raise SysidError(f"request {requested}, measurement {measured}: expected finite numbers")
        law = self._law
        self._next = law.A @ self._state + law.Br @ requested + law.By @ measured
        unlimited = np.asarray(law.C @ self._state + law.Dr @ requested + law.Dy @ measured)
        if law.correction is None or law.feedforward is None:
            return unlimited
        forward = law.feedforward @ np.concatenate([self._state, requested])
        return np.asarray(np.clip(unlimited, forward - law.correction, forward + law.correction))

    def applied(self, command: np.ndarray) -> None:
        """Tell the command (m,) that was applied at this sample, and advance to the next."""
        self._state = self._next + self._law.Bu @ command


def check_model(name: str, model: StateSpace, loops: int = 0, dt: float = 0.0, *, stable: bool = True) -> None:
    """Refuse a model of other inputs and outputs than the loops, with a direct term, at another dt, s, or unstable."""
    if not isinstance(model, StateSpace):
        raise SysidError(f"{name}: expected a StateSpace, got {type(model).__name__}")
    loops, dt = loops or model.nu, dt or model.dt
    fits = (model.nu, model.ny) == (loops, loops)
    # 1e-9: sampling intervals that differ by rounding are the same
    if not fits or model.D.any() or abs(model.dt / dt - 1.0) > 1e-9:
        direct = ", a direct term" if model.D.any() else ""
        raise SysidError(
            f"{name}: expected {loops} inputs and outputs, no direct term, at {dt:g} s, got {model.nu} and "
            f"{model.ny}{direct}, at {model.dt:g} s"
        )
    if stable and not model.is_stable():
        raise SysidError(f"{name}: expected a stable model, got poles to {abs(model.poles()[0]):.4g}")


def check_pair(plant: StateSpace, reference: StateSpace, loops: int = 0, dt: float = 0.0) -> None:
    """Refuse models of plant and reference by `check_model`, or without variances of the plant's innovations."""
    check_model("plant", plant, loops, dt)
    check_model("reference", reference, plant.nu, plant.dt)
    if plant.innovation_covariance is None or not np.diag(plant.innovation_covariance).all():
        raise SysidError("plant: expected a model with innovation covariance, without zero variances, as of estimates")

"""Linear controllers that know which command was applied: limits and delays cannot wind them up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray, Locked, lock, real_array
from sysid.records.errors import SysidError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


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
            presses against an obstacle; None for no bound.

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
        n, m = len(np.atleast_2d(self.A)), len(np.atleast_2d(self.Dr))
        shapes: dict[str, tuple[int, ...]] = {"A": (n, n), "C": (m, n), "Dr": (m, m), "Dy": (m, m)}
        shapes |= dict.fromkeys(("Br", "By", "Bu"), (n, m))
        if self.correction is not None:
            shapes |= {"feedforward": (m, n + m), "correction": (m,)}
        for name, shape in shapes.items():
            matrix = real_array(name, getattr(self, name))
            if matrix.shape != shape:
                raise SysidError(f"{name}: expected shape {shape} for {n} states and {m} loops, got {matrix.shape}")
            object.__setattr__(self, name, lock(matrix))

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
        m = self.loops
        if (plant.nu, plant.ny) != (m, m) or plant.D.any() or abs(plant.dt - self.dt) > 1e-9 * self.dt:
            raise SysidError(
                f"expected a plant of {m} inputs and outputs without direct term at {self.dt:g} s, got {plant.nu}, "
                f"{plant.ny}{', with direct term' if plant.D.any() else ''} at {plant.dt:g} s"
            )
        x, own = np.split(np.eye(plant.order + len(self.A)), [plant.order])
        measured, zero = plant.C @ x, np.zeros((m, m))
        command = self.C @ own + self.Dy @ measured
        A = np.vstack([plant.A @ x + plant.B @ command, self.A @ own + self.By @ measured + self.Bu @ command])
        B = np.block([[plant.B @ self.Dr, plant.B], [self.Br + self.Bu @ self.Dr, np.zeros((len(self.A), m))]])
        D = np.block([[zero, zero], [self.Dr, zero]])
        return StateSpace(A, B, np.vstack([measured, command]), D, None, self.dt)

    def loop_gain(self, plant: StateSpace, f_hz: "ArrayLike") -> np.ndarray:
        """Return the loop gain at the plant's input L = -K G (n_f, m, m), within all limits."""
        feedback = StateSpace(
            self.A + self.Bu @ self.C, self.By + self.Bu @ self.Dy, self.C, self.Dy, None, self.dt
        ).frequency_response(f_hz)
        return np.asarray(-feedback @ plant.frequency_response(f_hz))


class ControllerRun:
    """A controller at work, sample by sample; see `Controller`."""

    def __init__(self, controller: Controller) -> None:
        self._law = controller
        self._state, self._next = np.zeros(len(controller.A)), np.zeros(len(controller.A))

    def command(self, requested: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """Return the command u(t) (m,) for the request (m,) and the measurement (m,) of this sample."""
        law = self._law
        self._next = law.A @ self._state + law.Br @ requested + law.By @ measured
        wanted = np.asarray(law.C @ self._state + law.Dr @ requested + law.Dy @ measured)
        if law.correction is None or law.feedforward is None:
            return wanted
        forward = law.feedforward @ np.concatenate([self._state, requested])
        return np.asarray(np.clip(wanted, forward - law.correction, forward + law.correction))

    def applied(self, command: np.ndarray) -> None:
        """Tell the command (m,) that was applied at this sample, and advance to the next."""
        self._state = self._next + self._law.Bu @ command


def diagonal(controllers: Sequence[Controller]) -> Controller:
    """Return several controllers as one, side by side, without bounds of their corrections.

    Raises:
        SysidError: None given, or different sampling intervals.
    """
    if not controllers or len({one.dt for one in controllers}) > 1:
        raise SysidError("expected one or more controllers of one sampling interval")

    def block(name: str) -> FloatArray:
        return np.asarray(scipy.linalg.block_diag(*(getattr(one, name) for one in controllers)))

    A, Br, By, Bu, C, Dr, Dy = map(block, ("A", "Br", "By", "Bu", "C", "Dr", "Dy"))
    return Controller(A, Br, By, Bu, C, Dr, Dy, controllers[0].dt)

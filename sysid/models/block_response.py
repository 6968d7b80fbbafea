"""Output of a linear system block by block: samples of a block follow from its inputs and its first state by products.

With y(t + k) = C A^k x(t) + sum of h(k - i) u(t + i), h the pulse response, the samples of all blocks are two matrix
products, and only the first states of the blocks are a recursion. The sums are those of the plain recursion in another
sequence; they cost a twentieth of filters for each state.
"""

from dataclasses import dataclass

import numpy as np

from sysid.records.arrays import FloatArray

LENGTH = 32
"""Samples of a block: fewer leave more to the recursion, more cost more products."""

FEWEST = 4 * LENGTH
"""Samples of a record below which the products cost more than they save."""

GROWTH = 100.0
"""Largest entry of the powers of the state matrix: beyond it the products lose digits that filters keep."""

CHUNK = 2**13
"""Samples at a time: the memory beside the output does not grow with the record, and stays near the processor."""


@dataclass(frozen=True, eq=False)
class BlockSystem:
    """Matrices of x(t+1) = A x(t) + B u(t), y = C x + D u for blocks of LENGTH samples.

    Attributes:
        matrices: A, B, C and D.
        transition: A^LENGTH transposed (n, n).
        drive: From the inputs of a block to the state after it (LENGTH nu, n).
        observability: From the first state of a block to its outputs (n, LENGTH ny).
        response: From the inputs of a block to its outputs (LENGTH nu, LENGTH ny), zero for later inputs.
    """

    matrices: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    transition: FloatArray
    drive: FloatArray
    observability: FloatArray
    response: FloatArray

    @staticmethod
    def of(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, powers: FloatArray) -> "BlockSystem":
        """The matrices of a system, from the powers of A up to LENGTH."""
        n, nu, ny = len(A), B.shape[1], len(C)
        rows = C @ powers[:-1]
        pulse_response = np.empty((LENGTH, ny, nu))
        pulse_response[0] = D
        pulse_response[1:] = rows[:-1] @ B
        response = np.zeros((LENGTH, nu, LENGTH, ny))
        for i in range(LENGTH):
            response[i, :, i:] = pulse_response[: LENGTH - i].transpose(2, 0, 1)
        # the last input of a block has passed no step after it
        drive = (powers[:-1] @ B)[::-1].transpose(0, 2, 1)
        return BlockSystem(
            (A, B, C, D),
            powers[-1].T.copy(),
            drive.reshape(LENGTH * nu, n),
            rows.transpose(2, 0, 1).reshape(n, LENGTH * ny),
            response.reshape(LENGTH * nu, LENGTH * ny),
        )

    def output(self, u: FloatArray, x0: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Outputs (N, ny) for inputs (N, nu) from a state (n,), and the state after them, not finite on overflow."""
        A, B, C, D = self.matrices
        out = np.empty((len(u), len(C)))
        state = x0
        whole = len(u) // LENGTH * LENGTH
        with np.errstate(over="ignore", invalid="ignore"):
            for begin in range(0, whole, CHUNK):
                end = min(begin + CHUNK, whole)
                inputs = u[begin:end].reshape(-1, LENGTH * u.shape[1])
                states = chained(self.transition, inputs @ self.drive, state)
                outputs = inputs @ self.response
                outputs += states[:-1] @ self.observability
                out[begin:end] = outputs.reshape(end - begin, -1)
                state = states[-1]
            for t in range(whole, len(u)):
                out[t] = C @ state + D @ u[t]
                state = A @ state + B @ u[t]
        return out, state


def block_output(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, u: FloatArray, x0: FloatArray
) -> FloatArray | None:
    """Outputs (N, ny) of x(t+1) = A x(t) + B u(t), y = C x + D u from x0 (n,), for u (N, nu).

    None where products would lose digits or overflow, and where the record is too short for them to pay.
    """
    if len(u) < FEWEST or not len(A) or not u.shape[1]:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        powers = powers_up_to(A, LENGTH)
        # also false for NaN
        if not np.abs(powers).max() <= GROWTH:
            return None
    out, state = BlockSystem.of(A, B, C, D, powers).output(u, x0)
    return out if np.isfinite(state).all() else None


def powers_up_to(A: FloatArray, last: int) -> FloatArray:
    """A^0, ..., A^last by doubling (last + 1, n, n)."""
    powers = np.eye(len(A))[None]
    step = A
    while len(powers) <= last:
        powers = np.concatenate((powers, powers @ step))
        step = step @ step
    return powers[: last + 1]


def chained(transition: FloatArray, drive: FloatArray, first: FloatArray | None = None) -> FloatArray:
    """States before each block and after the last (blocks + 1, ..., n), x+ = x transition + drive (blocks, ..., n).

    They are summed over 1, 2, 4, ... blocks, from the first state (..., n), by default zero.
    """
    states = np.zeros((len(drive) + 1, *drive.shape[1:]))
    states[1:] = drive
    if first is not None:
        states[0] = first
    n, distance = len(transition), 1
    while distance < len(states):
        # the right-hand side is complete before the sum is stored
        passed_on = states[:-distance].reshape(-1, n) @ transition
        states[distance:] += passed_on.reshape(states[distance:].shape)
        distance, transition = 2 * distance, transition @ transition
    return states

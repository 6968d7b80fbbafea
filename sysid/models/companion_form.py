"""Systems in observer companion form, run as the filters that they are.

Polynomial models have this form: block by block, the coefficients of a denominator stand in the first column and ones
beside the diagonal. A change of basis, or powers of A, would lose digits where poles lie close together near one: the
roots of a denominator, and with them its response, move by far more than rounding. The filter computes with the
coefficients themselves.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.records.arrays import FloatArray

FIRST_LENGTH = 256  # samples after which most free responses have died out
NEGLIGIBLE = 1e-17  # of a free response, relative to its largest value


@dataclass(frozen=True, eq=False)
class CompanionForm:
    """A system matrix of companion blocks, each driven by inputs and by the first states of blocks before it.

    Attributes:
        A: The matrix (n, n).
        blocks: The states of each block, in an order in which every block comes after those that drive it.
        drivers: First states of the other blocks that drive a block, by its own first state.
    """

    A: FloatArray
    blocks: Sequence[slice]
    drivers: Mapping[int, Sequence[int]]

    @staticmethod
    def of(A: FloatArray) -> "CompanionForm | None":
        """The companion form of a matrix (n, n), None if it has none."""
        n = len(A)
        # a full matrix has no columns of zeros and a one, and each of its states drives all others
        if not n or (n > 1 and np.count_nonzero(A) == A.size):
            return None
        # the columns inside a block are unit vectors: its states are passed on to the one above
        inside = [j for j in range(1, n) if A[j - 1, j] == 1.0 and np.count_nonzero(A[:, j]) == 1]
        starts = [j for j in range(n) if j not in inside]
        blocks = [slice(start, end) for start, end in zip(starts, [*starts[1:], n], strict=True)]
        # row by block, column by the block whose first state drives it
        drives = np.logical_or.reduceat(A[:, starts] != 0.0, starts, axis=0)
        np.fill_diagonal(drives, False)
        drivers = {starts[k]: [starts[other] for other in np.flatnonzero(row)] for k, row in enumerate(drives)}
        ordered: list[slice] = []
        waiting = np.ones(len(blocks), dtype=bool)
        while waiting.any():
            ready = waiting & ~drives[:, waiting].any(axis=1)
            if not ready.any():
                return None
            ordered += [blocks[k] for k in np.flatnonzero(ready)]
            waiting &= ~ready
        return CompanionForm(A, ordered, drivers)

    @property
    def starts(self) -> list[int]:
        """The first state of each block."""
        return [block.start for block in self.blocks]

    def passes_on(self, C: FloatArray) -> bool:
        """Whether outputs C x (ny, n) depend on the first states of the blocks alone."""
        others = np.ones(len(self.A), dtype=bool)
        others[self.starts] = False
        return not C[:, others].any()

    def first_states(self, B: FloatArray, u: FloatArray, x0: FloatArray) -> dict[int, FloatArray]:
        """The first state (N,) of each block, by its number, for inputs u (N, nu) through B (n, nu) from x0 (n,)."""
        first_states: dict[int, FloatArray] = {}
        for block in self.blocks:
            denominator = np.concatenate(([1.0], -self.A[block, block.start]))
            state = x0[block]
            # the first filter starts from the state, the others of the sum from rest
            total = None
            for numerator, signal in self._drives(block, B, u, first_states):
                response, _ = scipy.signal.lfilter(numerator, denominator, signal, zi=state)
                total = response if total is None else total + response
                state = np.zeros(len(state))
            if total is None:
                total, _ = scipy.signal.lfilter([1.0], denominator, np.zeros(len(u)), zi=state)
            first_states[block.start] = total
        return first_states

    def _drives(
        self, block: slice, B: FloatArray, u: FloatArray, first_states: dict[int, FloatArray]
    ) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Numerator and signal of everything that drives a block: inputs, and first states of blocks before it."""
        for j in range(u.shape[1]):
            if B[block, j].any():
                yield np.concatenate(([0.0], B[block, j])), u[:, j]
        for start in self.drivers[block.start]:
            yield np.concatenate(([0.0], self.A[block, start])), first_states[start]

    def states(self, B: FloatArray, u: FloatArray, x0: FloatArray) -> FloatArray:
        """All states (N, n), for inputs u (N, nu) through B (n, nu) from x0 (n,)."""
        first_states = self.first_states(B, u, x0)
        drive = u @ B.T
        for start, signal in first_states.items():
            drive += signal[:, None] * self.A[:, start]
        states = np.empty((len(u), len(self.A)))
        for block in self.blocks:
            states[:, block.start] = first_states[block.start]
            # from the last state of the block upwards, each is the one below it and its drive, a sample ago
            for i in range(block.stop - 1, block.start, -1):
                states[0, i] = x0[i]
                states[1:, i] = drive[:-1, i]
                if i + 1 < block.stop:
                    states[1:, i] += states[:-1, i + 1]
        return states

    def free_response(self, C: FloatArray, steps: int) -> FloatArray:
        """C A^t for t = 0, 1, ... until it has died out, at most `steps` rows (rows, ny, n)."""
        length = min(FIRST_LENGTH, steps)
        while True:
            responses = self._free_response(C, length)
            size = np.abs(responses)
            largest = size.max(initial=0.0)
            if length == steps or not largest < np.inf or size[-(length // 4) :].max() <= NEGLIGIBLE * largest:
                return responses
            length = min(4 * length, steps)

    def _free_response(self, C: FloatArray, length: int) -> FloatArray:
        n = len(self.A)
        responses = np.zeros((length, len(C), n))
        starts = self.starts
        # from the last block backwards: what a block drives is known when its own turn comes
        for block in reversed(self.blocks):
            moved_to = np.flatnonzero(self.A[:, block.start])
            if len(moved_to) == 1 and block.stop == block.start + 1 and moved_to[0] != block.start:
                # a sample of delay: the response of the state that this one moves to, a sample later
                (to,) = moved_to
                responses[0, :, block.start] = C[:, block.start]
                responses[1:, :, block.start] = self.A[to, block.start] * responses[:-1, :, to]
                continue
            unit = np.zeros(n)
            unit[block.start] = 1.0
            with np.errstate(over="ignore", invalid="ignore"):
                first_states = self.first_states(np.zeros((n, 0)), np.zeros((length, 0)), unit)
                signals = np.array([first_states[start] for start in starts])
                response = (C[:, starts] @ signals).T
            # a state further down reaches the first one as many samples later
            for delay, i in enumerate(range(block.start, min(block.stop, block.start + length))):
                responses[delay:, :, i] = response[: length - delay]
        return responses

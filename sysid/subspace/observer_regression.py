"""Regression of outputs on past inputs and outputs, the first step of OKID, from blocks of samples."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sysid.models.data_summary import DataSummary
from sysid.polynomial.least_squares import LeastSquares, solve, solve_blocks
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

BLOCK = 2_000_000  # entries of a block of regressors, 16 MB


@dataclass(frozen=True, eq=False)
class ObserverRegression:
    """Equations y(t) = [D u(t)] + sum_i Ybar_i [u(t-i); y(t-i)], i = 1..p [Juang1993].

    Attributes:
        experiments: The records; equations with a missing output are omitted.
        p: Number of observer Markov parameters.
        direct: Whether D is estimated.
        at_rest: Whether all is zero before the first sample; otherwise the first p samples have no equation.
    """

    experiments: Sequence[IOData]
    p: int
    direct: bool
    at_rest: bool

    @property
    def width(self) -> int:
        """Coefficients per output."""
        first = self.experiments[0]
        return self.p * (first.nu + first.ny) + (first.nu if self.direct else 0)

    def rows(self) -> int:
        """Number of equations per output.

        Raises:
            SysidError: There are no more of them than coefficients.
        """
        count = sum(max(len(e) - self._start(e), 0) for e in self.experiments)
        if count <= self.width or any(len(e) <= self._start(e) for e in self.experiments):
            raise SysidError(
                f"too many observer parameters for the data: p = {self.p} gives {self.width} per output, "
                f"{count} usable samples in {len(self.experiments)} experiment(s)"
            )
        if all(e.complete for e in self.experiments):
            return count
        known = sum(len(block) for block in self.blocks())
        if known <= self.width:
            raise SysidError(
                f"too many missing samples: {known} of {count} equations are complete, {self.width} "
                "observer parameters per output need more; try a smaller p, or pem_ss, which uses every known output"
            )
        return known

    def solve(self) -> LeastSquares:
        """Least-squares solution; memory does not grow with the number of samples beyond a block."""
        columns = self.width + self.experiments[0].ny
        if sum(map(len, self.experiments)) * columns > BLOCK:
            return solve_blocks(self.blocks, self.width)
        whole = np.vstack(list(self.blocks()))
        return solve(whole[:, : self.width], whole[:, self.width :])

    def blocks(self) -> Iterator[FloatArray]:
        """Rows [u(t)], u(t-1), y(t-1), ..., u(t-p), y(t-p), y(t) in blocks (rows, width + ny)."""
        columns = self.width + self.experiments[0].ny
        most = max(BLOCK // columns, columns)
        for e in self.experiments:
            for first in range(self._start(e), len(e), most):
                block = self._block(e, first, min(first + most, len(e)))
                yield block if e.complete else block[np.isfinite(block).all(axis=1)]

    def names(self, data: DataSummary) -> tuple[str, ...]:
        """Names of the coefficients, output by output."""
        channels = (*data.input_names, *data.output_names)
        row = [f"{u}(t)" for u in data.input_names] if self.direct else []
        row += [f"{v}(t-{i})" for i in range(1, self.p + 1) for v in channels]
        return tuple(f"{y}: {name}" for y in data.output_names for name in row)

    def _start(self, e: IOData) -> int:
        return max(0 if self.at_rest else self.p, e.window)

    def _block(self, e: IOData, first: int, end: int) -> FloatArray:
        p, q, nu, rows = self.p, e.nu + e.ny, e.nu if self.direct else 0, end - first
        begin = max(first - p, 0)
        v = np.hstack((e.u[begin : end - 1], e.y[begin : end - 1]))
        before = np.vstack((np.zeros((max(p - first, 0), q)), v))
        out = np.empty((rows, self.width + e.ny))
        out[:, :nu] = e.u[first:end, :nu]
        latest_first = np.lib.stride_tricks.sliding_window_view(before, p, axis=0)[:, :, ::-1]
        out[:, nu : self.width].reshape(rows, p, q)[:] = latest_first.transpose(0, 2, 1)
        out[:, self.width :] = e.y[first:end]
        return out

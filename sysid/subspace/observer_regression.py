"""Regression of outputs on past inputs and outputs, the first step of OKID, from blocks of samples."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sysid.models.data_summary import DataSummary
from sysid.polynomial.least_squares import LeastSquares, solve, solve_blocks
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.repetition import Repetition

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
        lagged = self.p * (first.nu + first.ny)
        return lagged + first.nu if self.direct else lagged

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
        complete = sum(len(block) for block in self.blocks())
        if complete <= self.width:
            raise SysidError(
                f"too many missing samples: {complete} of {count} equations are complete, {self.width} "
                "observer parameters per output need more; try a smaller p, or pem_ss, which uses every known output"
            )
        return complete

    def solve(self) -> LeastSquares:
        """Least-squares solution; memory does not grow with the number of samples beyond a block."""
        columns = self.width + self.experiments[0].ny
        if sum(map(len, self.experiments)) * columns > BLOCK:
            return solve_blocks(self.blocks, self.width)
        table = np.vstack(list(self.blocks()))
        return solve(table[:, : self.width], table[:, self.width :])

    def blocks(self) -> Iterator[FloatArray]:
        """Rows [u(t)], u(t-1), y(t-1), ..., u(t-p), y(t-p), y(t) in blocks (rows, width + ny)."""
        for e in self.experiments:
            for first, end in self._spans(e):
                block = self._block(e, first, end)
                yield block if e.complete else block[np.isfinite(block).all(axis=1)]

    def _spans(self, e: IOData) -> Iterator[tuple[int, int]]:
        """First and end of the rows of each block of an experiment."""
        columns = self.width + e.ny
        # at least as many rows as columns, or the triangle of a block is no smaller than the block
        block_rows = max(BLOCK // columns, columns)
        for first in range(self._start(e), len(e), block_rows):
            yield first, min(first + block_rows, len(e))

    def errors(self, solution: FloatArray) -> list[FloatArray]:
        """Errors of the equations of a solution (width, ny), of each experiment (N_i, ny); zero without an equation."""
        errors = []
        for e in self.experiments:
            of_record = np.zeros((len(e), e.ny))
            for first, end in self._spans(e):
                block = self._block(e, first, end)
                of_record[first:end] = np.nan_to_num(block[:, self.width :] - block[:, : self.width] @ solution)
            errors.append(of_record)
        return errors

    def mean_regressors(self, group: Repetition) -> FloatArray:
        """Mean of the regressors over the periods of a sequence (period, width); zero without an equation."""
        total = np.zeros((group.period, self.width))
        for k, start in group.starts:
            e = self.experiments[k]
            first, end = max(start, self._start(e)), start + group.period
            if first >= end:
                continue
            block = self._block(e, first, end)
            # an equation with a missing sample is none
            block[~np.isfinite(block).all(axis=1)] = 0.0
            total[first - start :] += block[:, : self.width]
        return total / group.count

    def names(self, data: DataSummary) -> tuple[str, ...]:
        """Names of the coefficients, output by output."""
        regressors = [f"{u}(t)" for u in data.input_names] if self.direct else []
        for lag in range(1, self.p + 1):
            regressors += [f"{channel}(t-{lag})" for channel in (*data.input_names, *data.output_names)]
        names: list[str] = []
        for y in data.output_names:
            names += [f"{y}: {regressor}" for regressor in regressors]
        return tuple(names)

    def _start(self, e: IOData) -> int:
        """First sample of an experiment with an equation."""
        first_with_past = 0 if self.at_rest else self.p
        return max(first_with_past, e.window)

    def _block(self, e: IOData, first: int, end: int) -> FloatArray:
        """Equations of the samples from `first` to before `end`, rows as in `blocks`."""
        p, q, rows = self.p, e.nu + e.ny, end - first
        nu = e.nu if self.direct else 0
        begin = max(first - p, 0)
        v = np.hstack((e.u[begin : end - 1], e.y[begin : end - 1]))
        # before an experiment at rest all is zero
        before = np.vstack((np.zeros((max(p - first, 0), q)), v))
        out = np.empty((rows, self.width + e.ny))
        out[:, :nu] = e.u[first:end, :nu]
        # a view, copied once into place
        latest_first = np.lib.stride_tricks.sliding_window_view(before, p, axis=0)[:, :, ::-1]
        out[:, nu : self.width].reshape(rows, p, q)[:] = latest_first.transpose(0, 2, 1)
        out[:, self.width :] = e.y[first:end]
        return out

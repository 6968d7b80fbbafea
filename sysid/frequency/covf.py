"""Sample covariance functions of all channels of a record."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid.polynomial.correlation import covariance_function, covariance_with_gaps
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments


@dataclass(frozen=True, eq=False, repr=False)
class CovarianceFunction(Locked):
    """R(tau) = 1/N sum_t z(t + tau) z(t)' of z = [y; u].

    Attributes:
        lags: -lags, ..., lags in samples (2 lags + 1,).
        values: Covariances (2 lags + 1, ny + nu, ny + nu), in products of the channels' units.
        names: Outputs, then inputs.
        ny: Number of outputs.
        dt: Sampling interval in s.
    """

    lags: NDArray[np.int_]
    values: FloatArray
    names: tuple[str, ...]
    ny: int
    dt: float

    @property
    def output(self) -> FloatArray:
        """R_y (2 lags + 1, ny, ny)."""
        return self.values[:, : self.ny, : self.ny]

    @property
    def input(self) -> FloatArray:
        """R_u (2 lags + 1, nu, nu)."""
        return self.values[:, self.ny :, self.ny :]

    @property
    def cross(self) -> FloatArray:
        """R_yu, y later than u by the lag (2 lags + 1, ny, nu)."""
        return self.values[:, : self.ny, self.ny :]

    @property
    def normalised(self) -> FloatArray:
        """Correlation coefficients, by the standard deviations at lag 0; 0 for a channel that is zero."""
        sizes = np.sqrt(np.diagonal(self.values[len(self.lags) // 2]))
        sizes = np.where(sizes > 0.0, sizes, 1.0)
        return self.values / np.outer(sizes, sizes)


def covf(data: IOData | Sequence[IOData], *, lags: int = 25) -> CovarianceFunction:
    """Covariance functions of outputs and inputs [Ljung1999, sec. 6.1].

    Division is by N at every lag, so that the function is positive semidefinite. Means are not removed: detrend first.
    Initialisation windows are omitted; products do not cross the boundary of an experiment. With missing samples the
    known products are averaged, and the function need not be semidefinite.

    Args:
        data: One experiment, or several that are averaged.
        lags: Largest lag.

    Returns:
        Covariances of all pairs of channels, at lags -lags..lags.

    Raises:
        SysidError: lags not between 0 and N - 1.
    """
    experiments = tuple(e.scored for e in as_experiments(data, missing=True, series=True))
    shortest = min(len(e) for e in experiments)
    lags = whole_number("lags", lags, 0, shortest - 1)
    z = [np.hstack((e.y, e.u)) for e in experiments]
    first = experiments[0]
    # with gaps every lag has its own number of known products
    covariance = covariance_function if all(e.complete for e in experiments) else covariance_with_gaps
    names = (first.output_names or ()) + (first.input_names or ())
    return CovarianceFunction(np.arange(-lags, lags + 1), covariance(z, z, int(lags)), names, first.ny, first.dt)

"""Missing outputs as unknowns of the least squares: exact maximum likelihood without a Kalman filter.

Prediction errors are affine in the missing outputs, e = e0 + G m: each column of G is the response of the errors to a
pulse in y, shifted to the missing sample. With m eliminated, the likelihood of the known outputs consists of the least
sum of squares and of det(G'G)^-1/2 [Isaksson1993]. G'G is banded; of its inverse, the covariance of the missing
outputs, only the band is needed [Erisman1975].
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

BLOCK = 32  # least block size of the recursion for the band of the inverse: larger blocks, fewer Python steps


@dataclass(frozen=True, eq=False)
class MissingOutputs:
    """The columns of G and the factor of G'G.

    Attributes:
        rows: Number of samples N.
        times: Sample of each unknown, ascending (k,).
        channels: Output of each unknown (k,).
        response: Errors after a pulse in each output until they have died out: lag, error, output (L, ny, ny).
        spectrum: Fourier transform of the response.
        factor: Cholesky factor of G'G, lower and banded (band + 1, k).
    """

    rows: int
    times: NDArray[np.int_]
    channels: NDArray[np.int_]
    response: FloatArray
    spectrum: NDArray[np.complex128]
    factor: FloatArray

    @staticmethod
    def of(known: NDArray[np.bool_], response: FloatArray) -> "MissingOutputs":
        """Set up the elimination from the mask of known outputs (N, ny) and the pulse response (L, ny, ny)."""
        rows = len(known)
        response = response[:rows]
        times, channels = np.nonzero(~known)
        size = scipy.fft.next_fast_len(rows + len(response), real=True)
        last = np.searchsorted(times, times + len(response)) - 1
        band = int((last - np.arange(len(times))).max(initial=0))
        empty = np.zeros((band + 1, len(times)))
        bare = MissingOutputs(rows, times, channels, response, scipy.fft.rfft(response, size, axis=0), empty)
        if not len(times):
            return bare
        lag, to, valid = bare._pairs()
        # products of two columns of G are correlations of the response, but for what the end of the record cuts off
        correlations = _autocorrelation(response)
        by_pair = correlations[np.where(valid, lag, 0), channels[to], channels]
        gram = np.where(valid, by_pair, 0.0)
        ends = bare._beyond()
        products = ends @ ends.T
        first = len(times) - len(ends)
        for d in range(min(band + 1, len(ends))):
            gram[d, first : len(times) - d] -= np.diag(products, -d)
        try:
            factor = scipy.linalg.cholesky_banded(gram, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            raise SysidError(
                f"the {len(times)} missing outputs do not follow from the others: this model hardly forgets, and "
                "rounding decides; estimate from complete parts of the record, complete_parts(), or a smaller model"
            ) from None
        return replace(bare, factor=factor)

    @property
    def count(self) -> int:
        """Number of unknowns k."""
        return len(self.times)

    @property
    def log_determinant(self) -> float:
        """Logarithm of det(G'G)."""
        return 2.0 * float(np.log(self.factor[0]).sum())

    def applied(self, values: FloatArray) -> FloatArray:
        """G times values (k, q): errors (N, ny, q)."""
        ny, q = self.response.shape[1], values.shape[1]
        pulses = np.zeros((q, ny, self.rows))
        pulses[:, self.channels, self.times] = values.T
        if len(self.response) == 1:
            return np.einsum("ec,qct->teq", self.response[0], pulses)
        size = self._size
        spread = np.einsum("fec,qcf->qef", self.spectrum, scipy.fft.rfft(pulses, size))
        return np.ascontiguousarray(scipy.fft.irfft(spread, size)[:, :, : self.rows].transpose(2, 1, 0))

    def transposed(self, errors: FloatArray) -> FloatArray:
        """G' times errors (N, ny, q): (k, q)."""
        if len(self.response) == 1:
            return np.einsum("kec,teq->tcq", self.response, errors)[self.times, self.channels]
        size = self._size
        spread = scipy.fft.rfft(np.ascontiguousarray(errors.transpose(2, 1, 0)), size)
        products = scipy.fft.irfft(np.einsum("fec,qef->qcf", self.spectrum.conj(), spread), size)
        return np.ascontiguousarray(products[:, self.channels, self.times].T)

    def best(self, errors: FloatArray) -> FloatArray:
        """Least-squares coefficients of the errors in G (k, q)."""
        return np.asarray(
            scipy.linalg.cho_solve_banded((self.factor, True), self.transposed(errors), check_finite=False)
        )

    def eliminated(self, errors: FloatArray) -> FloatArray:
        """Errors (N, ny, q) minus their projection onto G."""
        return errors - self.applied(self.best(errors)) if self.count else errors

    def covariance(self) -> FloatArray:
        """Band of Z = (G'G)^-1: entry (j + d, j) in row d (band + 1, k).

        With G'G = L L' in blocks at least as large as the band, only L_bb and L_(b+1)b are not zero, and from the last
        block to the first, with N = L_(b+1)b L_bb^-1, Z_(b+1)b = -Z_(b+1)(b+1) N and Z_bb = L_bb^-T L_bb^-1 - N'
        Z_(b+1)b [Erisman1975].
        """
        width, k = self.factor.shape
        size = min(max(width - 1, BLOCK), k)
        blocks = -(-k // size)
        # an identity fills the last block
        padded = np.zeros((width, blocks * size))
        padded[:, :k] = self.factor
        padded[0, k:] = 1.0
        band = padded.reshape(width, blocks, size)
        inverse = np.linalg.inv(_blocks_of_band(band, 0))
        diagonal = np.matmul(inverse.transpose(0, 2, 1), inverse)
        normalised = np.matmul(_blocks_of_band(band, size)[:-1], inverse[:-1])
        below = np.zeros_like(diagonal)
        for b in range(blocks - 2, -1, -1):
            below[b] = -diagonal[b + 1] @ normalised[b]
            diagonal[b] -= normalised[b].T @ below[b]
        stacked = np.concatenate((diagonal, below), axis=1)
        index = np.arange(size)
        out = np.zeros((width, blocks * size))
        for d in range(width):
            out[d] = stacked[:, index + d, index].ravel()
            out[d, max(k - d, 0) :] = 0.0
        return out[:, :k]

    def slope(self, derivatives: FloatArray) -> FloatArray:
        """Derivatives of `log_determinant` (p,), from those of the response (p, L, ny, ny)."""
        if not self.count or not len(derivatives):
            return np.zeros(len(derivatives))
        lag, to, valid = self._pairs()
        covariance = self.covariance()
        ny, lags = self.response.shape[1], len(self.response)
        # d log det(G'G) = trace((G'G)^-1 d(G'G)), and an entry of G'G depends on lag and channels alone: sum the
        # covariances by these, those off the diagonal twice
        flat = (np.where(valid, lag, 0) * ny + self.channels[to]) * ny + self.channels
        twice = np.where(np.arange(len(covariance)) > 0, 2.0, 1.0)[:, None]
        summed = np.bincount(flat.ravel(), (twice * covariance * valid).ravel(), lags * ny * ny)
        weights = np.asarray(summed, dtype=np.float64).reshape(lags, ny, ny)
        # less the products beyond the end of the record
        ends = self._beyond()
        first, cut_off = self.count - len(ends), len(ends)
        corner = np.zeros((cut_off, cut_off))
        for d in range(min(len(covariance), cut_off)):
            entries = covariance[d, first : self.count - d]
            corner += np.diag(entries, -d)
            if d:
                corner += np.diag(entries, d)
        # the derivative is linear in that of the response: its coefficients, once for all parameters
        coefficients = _slope_of_correlations(weights, self.response)
        coefficients -= 2.0 * self._before_end(corner @ ends)
        return np.asarray(derivatives.reshape(len(derivatives), -1) @ coefficients.ravel())

    @property
    def _size(self) -> int:
        return scipy.fft.next_fast_len(self.rows + len(self.response), real=True)

    def _pairs(self) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.bool_]]:
        """Lag of each entry of the band, its row, and whether it exists (band + 1, k)."""
        k = self.count
        to = np.arange(len(self.factor))[:, None] + np.arange(k)
        inside = to < k
        to = np.minimum(to, k - 1)
        lag = self.times[to] - self.times
        return lag, to, inside & (lag < len(self.response))

    def _beyond(self) -> FloatArray:
        """Continuation of the columns of the last unknowns beyond the end of the record, one row each."""
        lags, ny = len(self.response), self.response.shape[1]
        padded = np.concatenate((self.response, np.zeros((lags, ny, ny))))
        steps, channels = self._continued()
        return padded[steps, :, channels].reshape(len(steps), (lags - 1) * ny)

    def _before_end(self, rows: FloatArray) -> FloatArray:
        """The transpose of `_beyond`: (L, ny, ny) from rows like those of it."""
        lags, ny = len(self.response), self.response.shape[1]
        padded = np.zeros((2 * lags, ny, ny))
        steps, channels = self._continued()
        errors = np.arange(ny)
        places = (steps[:, :, None], errors, channels[:, :, None])
        np.add.at(padded, places, rows.reshape(len(steps), lags - 1, ny))
        return padded[:lags]

    def _continued(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Samples of the response (m, L - 1) beyond the end of the record, and channels of these unknowns (m, 1)."""
        lags = len(self.response)
        last = np.flatnonzero(self.times + lags > self.rows)
        return self.rows - self.times[last][:, None] + np.arange(lags - 1), self.channels[last][:, None]


def _blocks_of_band(band: FloatArray, offset: int) -> FloatArray:
    """Blocks (blocks, size, size) of a lower banded matrix, on its diagonal or, with offset `size`, below it.

    The band is (width, blocks, size): entry (j + d, j) in row d, its columns in blocks.
    """
    width, _, size = band.shape
    row, column = np.indices((size, size))
    d = row - column + offset
    inside = ((d >= 0) & (d < width))[:, :, None]
    entries = band[np.clip(d, 0, width - 1), :, column]
    return np.where(inside, entries, 0.0).transpose(2, 0, 1)


def _slope_of_correlations(weights: FloatArray, response: FloatArray) -> FloatArray:
    """Derivatives of a weighted sum of the correlations of a response by its entries, all (L, ny, ny).

    The correlations are sums over s of response(s)[:, a]' response(s + lag)[:, b], the weights by lag, a and b.
    """
    lags = len(response)
    # twice the length: a circular correlation of less would wrap around
    size = scipy.fft.next_fast_len(2 * lags, real=True)
    spectrum, of_weights = scipy.fft.rfft(response, size, axis=0), scipy.fft.rfft(weights, size, axis=0)
    of_earlier = np.einsum("feb,fab->fea", spectrum, of_weights.conj())
    of_later = np.einsum("feb,fba->fea", spectrum, of_weights)
    return np.asarray(scipy.fft.irfft(of_earlier + of_later, size, axis=0)[:lags])


def _autocorrelation(response: FloatArray) -> FloatArray:
    """Sums over s of response(s)[:, a]' response(s + lag)[:, b], (L, ny, ny)."""
    lags = len(response)
    # twice the length: a circular correlation of less would wrap around
    size = scipy.fft.next_fast_len(2 * lags, real=True)
    spectrum = scipy.fft.rfft(response, size, axis=0)
    product = np.einsum("fea,feb->fab", spectrum.conj(), spectrum)
    return np.asarray(scipy.fft.irfft(product, size, axis=0)[:lags])

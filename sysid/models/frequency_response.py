"""Frequency responses with their uncertainty, from any method."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.records.arguments import real_number, sampling_interval, shown
from sysid.records.arrays import ComplexArray, FloatArray, Locked, complex_array, real_array, rectangular
from sysid.records.channels import channel_indices, channel_labels, default_names
from sysid.records.data import LARGEST
from sysid.records.errors import SysidError
from sysid.records.labelled import Labelled

NORMAL_95 = 1.959963984540054
AXES = {
    "response": "fyu",
    "coherence": "fyu",
    "cross_spectrum": "fyu",
    "noise_spectrum": "fyy",
    "output_spectrum": "fyy",
    "frequencies": "f",
    "noise_deviation": "fy",
    "resolution": "f",
    "input_spectrum": "fuu",
    "covariance": "fyupp",
    "joint_covariance": "fee",
}
"""Axes of the arrays: frequency, output, input, part (real, imaginary), entry of the response (output by output)."""

FAR = 20.0  # standard deviations from zero beyond which the Rice distribution is normal


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Labelled, Locked):
    """A response over frequency, with the spectra that it was computed from.

    Spectra are two-sided densities: the sum over -Nyquist..Nyquist times the spacing in Hz is the variance.

    Attributes:
        frequencies: Hz, ascending (nf,).
        response: Complex response (nf, ny, nu); NaN where the data do not determine it.
        dt: Sampling interval in s; 0 in continuous time.
        method: Name of the estimator.
        covariance: Of (real part, imaginary part) of every entry (nf, ny, nu, 2, 2), NaN where the response is; None
            where the method has none.
        coherence: |Phi_yu|^2 / (Phi_y Phi_u) per pair (nf, ny, nu), 0..1; None where the method has none.
        noise_spectrum: Spectrum of the disturbance (nf, ny, ny), unit^2/Hz.
        input_spectrum: Phi_u (nf, nu, nu), unit^2/Hz.
        output_spectrum: Phi_y (nf, ny, ny), unit^2/Hz.
        cross_spectrum: Phi_yu (nf, ny, nu).
        joint_covariance: Circular covariance of all entries, row by row (nf, ny nu, ny nu); where it is None, entries
            depend on each other as the spectra imply, or are independent.
        resolution: Hz over which errors of neighbouring frequencies depend on each other, by smoothing (nf,); None
            where frequencies are independent.
        noise_deviation: Standard deviation of the logarithm of the disturbance's spectrum, per output (nf, ny); of
            parametric models.
        degrees_of_freedom: Of the variance behind `covariance` and `noise_spectrum`; None for a parametric model, whose
            intervals are those of the normal distribution.
        noise_is_corrected: Whether `noise_spectrum` is corrected for what the fit of the response removed from it.
        input_names: One name per input.
        output_names: One name per output.
    """

    frequencies: FloatArray
    response: ComplexArray
    dt: float
    method: str
    covariance: FloatArray | None = None
    coherence: FloatArray | None = None
    noise_spectrum: ComplexArray | None = None
    input_spectrum: ComplexArray | None = None
    output_spectrum: ComplexArray | None = None
    cross_spectrum: ComplexArray | None = None
    degrees_of_freedom: float | None = None
    joint_covariance: ComplexArray | None = field(default=None, kw_only=True)
    resolution: FloatArray | None = field(default=None, kw_only=True)
    noise_deviation: FloatArray | None = field(default=None, kw_only=True)
    noise_is_corrected: bool = field(default=False, kw_only=True)
    input_names: tuple[str, ...] = field(default=(), kw_only=True)
    output_names: tuple[str, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        """Check shapes and lock."""
        nf = len(self.frequencies)
        if self.response.ndim != 3 or len(self.response) != nf:
            raise SysidError(f"response: expected shape ({nf}, ny, nu), got {self.response.shape}")
        _, ny, nu = self.response.shape
        sizes = {"f": nf, "y": ny, "u": nu, "p": 2, "e": ny * nu}
        for attribute, axes in AXES.items():
            value, shape = getattr(self, attribute), tuple(sizes[axis] for axis in axes)
            if value is not None and value.shape != shape:
                raise SysidError(f"{attribute}: expected shape {shape}, got {value.shape}")
        object.__setattr__(self, "frequencies", np.asarray(self.frequencies, dtype=float))
        object.__setattr__(self, "response", np.asarray(self.response, dtype=complex))
        super().__post_init__()

    @staticmethod
    def from_data(
        hz: ArrayLike,
        response: ArrayLike,
        *,
        dt: float = 0.0,
        variance: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        coherence: ArrayLike | None = None,
        averages: float | None = None,
        input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
    ) -> "FrequencyResponse":
        """A response that was measured elsewhere, as by an analyser, with at most one statement of its uncertainty.

        Args:
            hz: Frequencies in Hz, ascending (nf,).
            response: Complex response (nf, ny, nu), or (nf,) for one input and one output.
            dt: Sampling interval in s; 0 in continuous time.
            variance: Mean of |error|^2 of every entry, shape as `response`.
            covariance: Of all entries, row by row, E e e* (nf, ny nu, ny nu).
            coherence: With one input, shape as `response`; the variance is |G|^2 (1 - c) / (c (averages - 1)).
            averages: Number of independent averages behind `coherence`.
            input_names: One name per input.
            output_names: One name per output.

        Raises:
            SysidError: Wrong shapes, NaN, frequencies that do not ascend or pass Nyquist, negative variances.
        """
        f = np.atleast_1d(real_array("hz", hz))
        values = np.atleast_1d(complex_array("response", response))
        values = values[:, None, None] if values.ndim == 1 else values
        if f.ndim != 1 or values.ndim != 3 or len(f) != len(values) or not values.size:
            raise SysidError(f"expected hz (nf,) and response (nf, ny, nu), got {f.shape} and {values.shape}")
        dt = sampling_interval(dt, continuous=True)
        # as for signals, so that sums of squares stay finite
        if (np.abs(values) > LARGEST).any() or 0.0 < np.abs(values).max() < 1.0 / LARGEST:
            raise SysidError(
                f"response: expected values up to {LARGEST:g} and not all below its inverse: change the unit"
            )
        _check_ascending(f, dt)
        statements = [value for value in (variance, covariance, coherence) if value is not None]
        if len(statements) > 1:
            raise SysidError("expected one of variance, covariance and coherence, got several")
        if averages is not None and coherence is None:
            raise SysidError("averages belong to a coherence, of which there is none")
        joint, freedom = None, None
        if coherence is not None:
            variance, freedom = _variance_of_coherence(values, coherence, averages)
        if covariance is not None:
            joint = _joint_covariance(covariance, values)
            variance = np.einsum("fee->fe", joint).real
        parts_covariance = None
        if variance is not None:
            variance = _like("variance", variance, values.shape)
            if (variance < 0.0).any():
                raise SysidError("variance: expected values >= 0, got negative ones")
            parts_covariance = complex_covariance(variance, f, dt, doubled=coherence is not None)
        _, ny, nu = values.shape
        return FrequencyResponse(
            f,
            values,
            dt,
            "data",
            parts_covariance,
            degrees_of_freedom=freedom,
            joint_covariance=joint,
            input_names=channel_labels("input_names", input_names, default_names("u", nu)),
            output_names=channel_labels("output_names", output_names, default_names("y", ny)),
        )

    @property
    def _names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of inputs and outputs."""
        _, ny, nu = self.response.shape
        return self.input_names or default_names("u", nu), self.output_names or default_names("y", ny)

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Variables, coordinates and attributes of the data set: the response of paths, the disturbance of outputs."""
        path = ("frequency", "output", "input")
        inputs, outputs = self._names
        arrays: dict[str, Any] = {}
        coordinates: dict[str, Any] = {
            "frequency": ("frequency", self.frequencies, {"units": "Hz"}),
            "output": list(outputs),
        }
        if inputs:
            arrays["response"] = (path, self.response)
            arrays["magnitude"] = (path, self.magnitude)
            arrays["phase"] = (path, self.phase, {"units": "rad"})
            if self.covariance is not None:
                arrays["magnitude_deviation"] = (path, self.magnitude_deviation())
                arrays["phase_deviation"] = (path, self.phase_deviation(), {"units": "rad"})
            if self.coherence is not None:
                arrays["coherence"] = (path, self.coherence)
            coordinates["input"] = list(inputs)
        if self.noise_spectrum is not None:
            arrays["noise_spectrum"] = (path[:2], np.einsum("fii->fi", self.noise_spectrum).real)
        return arrays, coordinates, {"method": self.method, "dt": self.dt}

    def _shown(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """The variables as the printed table shows them."""
        variables, coordinates, attributes = self._variables()
        if "phase" in variables:
            # printed rows are too far apart for an unwrapped phase to be followed
            axes, _, units = variables["phase"]
            variables["phase"] = (axes, np.angle(self.response), units)
        return variables, coordinates, attributes

    def select(
        self,
        kept: ArrayLike | slice | None = None,
        *,
        inputs: Sequence[int | str] | None = None,
        outputs: Sequence[int | str] | None = None,
    ) -> "FrequencyResponse":
        """Return some frequencies, inputs and outputs, with all that is known of them.

        Args:
            kept: Mask (nf,), indices or slice of the frequencies; all by default.
            inputs: Inputs by name or index; all by default.
            outputs: Outputs by name or index; all by default.

        Raises:
            SysidError: A mask of another length, an index or a channel that does not exist.
        """
        nf, _, nu = self.response.shape
        input_names, output_names = self._names
        u = channel_indices("input", inputs, input_names)
        y = channel_indices("output", outputs, output_names)
        if kept is None:
            kept = slice(None)
        selection = kept if isinstance(kept, slice) else rectangular("kept", kept)
        try:
            f = np.arange(nf)[selection]
        except IndexError as error:
            raise SysidError(f"kept: expected a mask of {nf} frequencies or indices below {nf}") from error
        if f.ndim != 1:
            raise SysidError(f"kept: expected a mask of {nf} frequencies or a list of indices, got {shown(kept)}")
        # entries of the response are numbered output by output
        entries = (np.array(y)[:, None] * nu + np.array(u)).ravel()
        index = {"f": f, "y": y, "u": u, "p": range(2), "e": entries}
        selected: dict[str, Any] = {
            "input_names": tuple(input_names[j] for j in u),
            "output_names": tuple(output_names[i] for i in y),
        }
        for attribute, axes in AXES.items():
            value = getattr(self, attribute)
            if value is not None:
                selected[attribute] = value[np.ix_(*(index[axis] for axis in axes))]
        return replace(self, **selected)

    def determined(self) -> "FrequencyResponse":
        """Return the response at the frequencies at which the data determine all of it."""
        finite = np.isfinite(self.response).all(axis=(1, 2))
        if self.covariance is not None:
            finite &= np.isfinite(self.covariance).all(axis=(1, 2, 3, 4))
        return self.select(finite)

    def full_covariance(self) -> FloatArray:
        """Covariance of real and imaginary part of all entries, entry by entry (nf, 2 ny nu, 2 ny nu).

        Errors of a nonparametric estimate depend on each other as E e_ij e_kl* = Phi_v,ik (Phi_u^-1)_lj / K.

        Raises:
            SysidError: The method gave no covariance.
        """
        if self.covariance is None:
            raise SysidError(f"{self.method} gives no covariance of its frequency response")
        nf, ny, nu = self.response.shape
        correlation = self._correlation_of_entries()
        # a circular complex error, as real numbers
        real_correlation = np.array([[correlation.real, -correlation.imag], [correlation.imag, correlation.real]])
        values, vectors = np.linalg.eigh(self.covariance.reshape(nf, ny * nu, 2, 2))
        deviations = np.sqrt(np.maximum(values, 0.0))
        root = np.einsum("fepk,fek,feqk->fepq", vectors, deviations, vectors)
        full = np.einsum("fapi,ijfab,fbqj->fapbq", root, real_correlation, root)
        return np.asarray(full.reshape(nf, 2 * ny * nu, 2 * ny * nu))

    def _correlation_of_entries(self) -> ComplexArray | FloatArray:
        """Correlation of the complex errors of all entries, row by row (nf, ny nu, ny nu); the identity if unknown."""
        nf, ny, nu = self.response.shape
        shape = (nf, ny * nu, ny * nu)
        joint = self.joint_covariance
        if joint is None and self.noise_spectrum is not None and self.input_spectrum is not None:
            inverse = np.linalg.pinv(self.input_spectrum, hermitian=True)
            joint = np.einsum("fik,flj->fijkl", self.noise_spectrum, inverse).reshape(shape)
        if joint is None:
            return np.broadcast_to(np.eye(ny * nu), shape)
        power = np.einsum("fee->fe", joint).real
        # an entry without error, an output that the inputs explain wholly, correlates with nothing
        size = np.sqrt(np.where(power > np.finfo(float).tiny, power, np.inf))
        return joint / size[:, :, None] / size[:, None, :]

    @property
    def magnitude(self) -> FloatArray:
        """Modulus of the response (nf, ny, nu)."""
        return np.abs(self.response)

    @property
    def phase(self) -> FloatArray:
        """Phase in rad, unwrapped along frequency (nf, ny, nu); NaN where the response is."""
        out = np.full(self.response.shape, np.nan)
        for i, j in np.ndindex(out.shape[1:]):
            # a NaN would spread over all later frequencies
            finite = np.isfinite(self.response[:, i, j])
            out[finite, i, j] = np.unwrap(np.angle(self.response[finite, i, j]))
        return out

    def magnitude_deviation(self) -> FloatArray:
        """Standard deviation of the magnitude to first order (nf, ny, nu).

        Raises:
            SysidError: The method gave no covariance.
        """
        return self._along(self._direction())

    def phase_deviation(self) -> FloatArray:
        """Standard deviation of the phase in rad to first order (nf, ny, nu).

        Raises:
            SysidError: The method gave no covariance.
        """
        # a response of zero has no phase: the deviation is out of all bounds
        return self._along(1j * self._direction()) / np.maximum(self.magnitude, np.finfo(float).tiny)

    def magnitude_ci95(self) -> tuple[FloatArray, FloatArray]:
        """95 % interval of the magnitude, never below zero, (nf, ny, nu) each.

        The modulus of a normal complex error has a Rice distribution [Rice1945]: its noncentrality is inverted where
        the error is not small against the response, so that a response lost in noise is not claimed to be above zero.

        Raises:
            SysidError: The method gave no covariance.
        """
        size = self.magnitude
        # Student's quantile instead of the normal one: the variance of the error is itself estimated.
        deviation = self.magnitude_deviation() * (self.quantile_95 / NORMAL_95)
        low, high = size - NORMAL_95 * deviation, size + NORMAL_95 * deviation
        # at 0 Hz and the Nyquist frequency the error has one dimension, elsewhere two
        real = self._along(1j * self._direction()) <= 1e-6 * deviation
        # of an exact response the ratio is infinite
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = size / deviation
        for mask, dimensions in ((real, 1), (~real, 2)):
            near_zero = mask & (ratio < FAR)
            low_ratio, high_ratio = _rice_interval(ratio[near_zero], dimensions)
            low[near_zero] = deviation[near_zero] * low_ratio
            high[near_zero] = deviation[near_zero] * high_ratio
        return low, high

    def phase_ci95(self) -> tuple[FloatArray, FloatArray]:
        """95 % interval of the phase in rad round the unwrapped phase, (nf, ny, nu) each.

        Raises:
            SysidError: The method gave no covariance.
        """
        reach = self.quantile_95 * self.phase_deviation()
        return self.phase - reach, self.phase + reach

    def noise_ci95(self) -> tuple[FloatArray, FloatArray]:
        """95 % interval of the disturbance's spectrum per output (nf, ny) each.

        Of a parametric model it is that of the spectrum's logarithm; otherwise by the chi-square distribution.
        The fitted response has removed a part of the spectrum, so that the interval is not centred on it. At 0 Hz and
        at the Nyquist frequency it holds half the degrees of freedom and the interval is too narrow.

        Raises:
            SysidError: The method gave no disturbance spectrum, or one of unknown degrees of freedom.
        """
        if self.noise_spectrum is not None and self.noise_deviation is not None:
            power, factor = np.einsum("fii->fi", self.noise_spectrum).real, np.exp(NORMAL_95 * self.noise_deviation)
            return power / factor, power * factor
        if self.noise_spectrum is None or self.degrees_of_freedom is None:
            raise SysidError(f"{self.method} gives no disturbance spectrum with degrees of freedom")
        freedom = self.degrees_of_freedom
        # the sum of squares: with freedom = 2 (K - nu), 2 K times the spectrum that the fit of nu responses has left
        removed = 0.0 if self.noise_is_corrected else 2.0 * self.response.shape[2]
        total = np.einsum("fii->fi", self.noise_spectrum).real * (freedom + removed)
        # some lag windows make a spectrum negative
        total = np.maximum(total, 0.0)
        return total / scipy.stats.chi2.ppf(0.975, freedom), total / scipy.stats.chi2.ppf(0.025, freedom)

    @property
    def quantile_95(self) -> float:
        """Half-width of a 95 % interval in standard deviations: Student's, or normal without degrees of freedom."""
        if self.degrees_of_freedom is None:
            return NORMAL_95
        return float(scipy.stats.t.ppf(0.975, self.degrees_of_freedom))

    def _direction(self) -> ComplexArray:
        """Unit vector along the response (nf, ny, nu)."""
        # NaN stays NaN, without a warning of numpy
        with np.errstate(invalid="ignore"):
            return np.asarray(self.response / np.maximum(self.magnitude, np.finfo(float).tiny))

    def _along(self, direction: ComplexArray) -> FloatArray:
        """Standard deviation of the response along unit vectors (nf, ny, nu)."""
        if self.covariance is None:
            raise SysidError(f"{self.method} gives no covariance of its frequency response")
        d = np.stack((direction.real, direction.imag), axis=-1)
        return np.sqrt(np.maximum(np.einsum("...i,...ij,...j->...", d, self.covariance, d), 0.0))


def _rice_interval(ratio: FloatArray, dimensions: int) -> tuple[FloatArray, FloatArray]:
    """95 % interval of a vector's length from its measured length (n,), both in standard deviations."""
    # chndtrinc solves for the noncentrality; the floor keeps its argument from zero, where it has no solution
    low = np.sqrt(scipy.special.chndtrinc(np.maximum(ratio, 0.1) ** 2, dimensions, 0.975))
    # A length that is small by chance must not bound the true one closer than one standard deviation.
    high = np.sqrt(scipy.special.chndtrinc(np.maximum(ratio, 1.0) ** 2, dimensions, 0.025))
    return low, high


def complex_covariance(variance: FloatArray, f: FloatArray, dt: float, *, doubled: bool = True) -> FloatArray:
    """Half of the variance in each part (..., 2, 2); all of it in the real part at 0 and Nyquist, where G is real.

    A spectral estimate has half as many averages there, so that its variance is `doubled`.
    """
    out = np.zeros((*variance.shape, 2, 2))
    nyquist = 0.5 / dt if dt else np.inf
    is_real = ((f == 0.0) | np.isclose(f, nyquist))[:, None, None]
    factor_where_real = 2.0 if doubled else 1.0
    out[..., 0, 0] = np.where(is_real, factor_where_real, 0.5) * variance
    out[..., 1, 1] = np.where(is_real, 0.0, 0.5) * variance
    return out


def _check_ascending(f: FloatArray, dt: float) -> None:
    """Refuse frequencies that do not ascend from 0 Hz, or that pass Nyquist."""
    nyquist = 0.5 / dt if dt else np.inf
    # the last line of a transform is Nyquist but for rounding
    if f[0] < 0.0 or (np.diff(f) <= 0.0).any() or f[-1] > nyquist * (1.0 + 1e-9):
        limit = f" up to Nyquist, {nyquist:g} Hz" if dt else ""
        raise SysidError(f"hz: expected ascending frequencies from 0{limit}, got {f[0]:g} to {f[-1]:g} Hz")


def _variance_of_coherence(
    response: ComplexArray, coherence: ArrayLike, averages: float | None
) -> tuple[FloatArray, float]:
    """Variance |G|^2 (1 - c) / (c (averages - 1)) of each entry, and its degrees of freedom."""
    count = real_number("averages", averages, "be a number above 1", lambda k: 1.0 < k < np.inf)
    c = _like("coherence", coherence, response.shape)
    if response.shape[2] > 1 or (c <= 0.0).any() or (c > 1.0).any():
        raise SysidError("coherence: expected values above 0 and up to 1 of one input; else pass a covariance")
    variance = np.abs(response) ** 2 * (1.0 - c) / (c * (count - 1.0))
    return variance, 2.0 * (count - 1.0)


def _joint_covariance(covariance: ArrayLike, response: ComplexArray) -> ComplexArray:
    """Check a covariance of all entries, row by row (nf, ny nu, ny nu)."""
    joint = complex_array("covariance", covariance)
    nf, size = len(response), response[0].size
    if joint.shape != (nf, size, size) or not np.allclose(joint, joint.conj().transpose(0, 2, 1)):
        raise SysidError(f"covariance: expected Hermitian ({nf}, {size}, {size}), got {joint.shape}")
    return joint


def _like(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Real array of as many values as `shape` has, in this shape."""
    out = real_array(name, value)
    if out.size != np.prod(shape):
        raise SysidError(f"{name}: expected shape {shape}, got {out.shape}")
    return out.reshape(shape)

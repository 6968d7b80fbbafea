"""Frequency responses with their uncertainty, from any method."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy

from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.records.errors import SysidError

NORMAL_95 = 1.959963984540054
FAR = 20.0  # standard deviations from zero beyond which the Rice distribution is normal


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Locked):
    """A response over frequency, with the spectra that it was computed from.

    Spectra are two-sided densities: the sum over -Nyquist..Nyquist times the spacing in Hz is the variance.

    Attributes:
        frequencies: Hz, ascending (nf,).
        response: Complex response (nf, ny, nu); NaN where the data do not determine it.
        dt: Sampling interval in s.
        method: Name of the estimator.
        covariance: Of (real part, imaginary part) of every entry (nf, ny, nu, 2, 2), NaN where the response is; None
            where the method has none.
        coherence: |Phi_yu|^2 / (Phi_y Phi_u) per pair (nf, ny, nu), 0..1; None where the method has none.
        noise_spectrum: Spectrum of the disturbance (nf, ny, ny), unit^2/Hz.
        input_spectrum: Phi_u (nf, nu, nu), unit^2/Hz.
        output_spectrum: Phi_y (nf, ny, ny), unit^2/Hz.
        cross_spectrum: Phi_yu (nf, ny, nu).
        degrees_of_freedom: Of the variance behind `covariance` and `noise_spectrum`; None for a parametric model, whose
            intervals are those of the normal distribution.
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
    input_names: tuple[str, ...] = field(default=(), kw_only=True)
    output_names: tuple[str, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        """Check shapes and lock."""
        nf = len(self.frequencies)
        if self.response.ndim != 3 or len(self.response) != nf:
            raise SysidError(f"response: expected shape ({nf}, ny, nu), got {self.response.shape}")
        _, ny, nu = self.response.shape
        shapes = {
            "covariance": (nf, ny, nu, 2, 2),
            "coherence": (nf, ny, nu),
            "noise_spectrum": (nf, ny, ny),
            "input_spectrum": (nf, nu, nu),
            "output_spectrum": (nf, ny, ny),
            "cross_spectrum": (nf, ny, nu),
        }
        for attribute, shape in shapes.items():
            value = getattr(self, attribute)
            if value is not None and value.shape != shape:
                raise SysidError(f"{attribute}: expected shape {shape}, got {value.shape}")
        object.__setattr__(self, "frequencies", np.asarray(self.frequencies, dtype=float))
        object.__setattr__(self, "response", np.asarray(self.response, dtype=complex))
        super().__post_init__()

    def determined(self) -> "FrequencyResponse":
        """Return the response at the frequencies at which the data determine all of it."""
        kept = np.isfinite(self.response).all(axis=(1, 2))
        parts: dict[str, Any] = {name: one[kept] for name, one in vars(self).items() if isinstance(one, np.ndarray)}
        return replace(self, **parts)

    @property
    def magnitude(self) -> FloatArray:
        """Modulus of the response (nf, ny, nu)."""
        return np.abs(self.response)

    @property
    def phase(self) -> FloatArray:
        """Phase in rad, unwrapped along frequency (nf, ny, nu); NaN where the response is."""
        out = np.full(self.response.shape, np.nan)
        for i, j in np.ndindex(out.shape[1:]):
            known = np.isfinite(self.response[:, i, j])
            out[known, i, j] = np.unwrap(np.angle(self.response[known, i, j]))
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
        real = self._along(1j * self._direction()) <= 1e-6 * deviation
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = size / deviation
        for entries, dimensions in ((real, 1), (~real, 2)):
            near = entries & (ratio < FAR)
            edges = _rice_interval(ratio[near], dimensions)
            low[near], high[near] = deviation[near] * edges[0], deviation[near] * edges[1]
        return low, high

    def phase_ci95(self) -> tuple[FloatArray, FloatArray]:
        """95 % interval of the phase in rad round the unwrapped phase, (nf, ny, nu) each.

        Raises:
            SysidError: The method gave no covariance.
        """
        reach = self.quantile_95 * self.phase_deviation()
        return self.phase - reach, self.phase + reach

    def noise_ci95(self) -> tuple[FloatArray, FloatArray]:
        """95 % interval of the disturbance's spectrum per output, by the chi-square distribution (nf, ny) each.

        The fitted response has removed a part of the spectrum, so that the interval is not centred on it. At 0 Hz and
        at the Nyquist frequency it holds half the degrees of freedom and the interval is too narrow.

        Raises:
            SysidError: The method gave no disturbance spectrum, or one of unknown degrees of freedom.
        """
        if self.noise_spectrum is None or self.degrees_of_freedom is None:
            raise SysidError(f"{self.method} gives no disturbance spectrum with degrees of freedom")
        freedom = self.degrees_of_freedom
        total = np.einsum("fii->fi", self.noise_spectrum).real * (freedom + 2.0 * self.response.shape[2])
        total = np.maximum(total, 0.0)
        return total / scipy.stats.chi2.ppf(0.975, freedom), total / scipy.stats.chi2.ppf(0.025, freedom)

    @property
    def quantile_95(self) -> float:
        """Half-width of a 95 % interval in standard deviations: Student's, or normal without degrees of freedom."""
        return (
            NORMAL_95 if self.degrees_of_freedom is None else float(scipy.stats.t.ppf(0.975, self.degrees_of_freedom))
        )

    def _direction(self) -> ComplexArray:
        # NaN stays NaN, without a warning of numpy
        with np.errstate(invalid="ignore"):
            return np.asarray(self.response / np.maximum(self.magnitude, np.finfo(float).tiny))

    def _along(self, direction: ComplexArray) -> FloatArray:
        if self.covariance is None:
            raise SysidError(f"{self.method} gives no covariance of its frequency response")
        d = np.stack((direction.real, direction.imag), axis=-1)
        return np.sqrt(np.maximum(np.einsum("...i,...ij,...j->...", d, self.covariance, d), 0.0))


def _rice_interval(ratio: FloatArray, dimensions: int) -> tuple[FloatArray, FloatArray]:
    """95 % interval of a vector's length from its measured length (n,), both in standard deviations."""
    # A length that is small by chance must not bound the true one closer than one standard deviation.
    low, high = (
        np.sqrt(scipy.special.chndtrinc(np.maximum(ratio, least) ** 2, dimensions, probability))
        for least, probability in ((0.1, 0.975), (1.0, 0.025))
    )
    return low, high

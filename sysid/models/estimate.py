"""The result that every parametric estimator returns, and the uncertainty of its response and bandwidth."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.data_summary import DataSummary
from sysid.models.delta_method import spread
from sysid.models.frequency_response import NORMAL_95, FrequencyResponse
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace
from sysid.records.arguments import frequency_list
from sysid.records.arrays import ComplexArray, FloatArray, Locked, locked_within
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.labelled import Labelled
from sysid.records.printing import LISTED, Part, Table, counted, numbers, poles_table, uncertain

if TYPE_CHECKING:
    import control

    from sysid.models.continuous_model import ContinuousModel

SLOPE_STEP = 1e-4  # relative step of the central difference for the slope of the gain at the bandwidth
VAGUE = 3.5  # standard deviation of a bandwidth's logarithm from which its interval is useless: a factor of a thousand


@dataclass(frozen=True, eq=False, repr=False)
class Bandwidth(Locked):
    """Half-power bandwidths with 95 % intervals.

    Attributes:
        hz: First frequency 3.01 dB below the gain at the reference (ny, nu); NaN where there is none below Nyquist.
        ci95: Lower and upper end (ny, nu) each, symmetric on a logarithmic scale as far as the Nyquist frequency; NaN
            where `hz` is.
        reference: Frequency of the gain that it falls from, Hz.
    """

    hz: FloatArray
    ci95: tuple[FloatArray, FloatArray]
    reference: float = 0.0

    def covers(self, hz: ArrayLike) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether the interval contains `hz`, entry by entry (ny, nu); False where there is no bandwidth."""
        value = np.asarray(hz, dtype=float)
        return (self.ci95[0] <= value) & (value <= self.ci95[1])

    def path(self, output: int = 0, input: int = 0) -> tuple[float, float, float]:
        """Bandwidth of the path from one input to one output, and the ends of its interval, Hz."""
        low, high = (float(end[output, input]) for end in self.ci95)
        return float(self.hz[output, input]), low, high


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Labelled, Locked):
    """A model with its parameters, their covariance, and the diagnostics of the fit.

    Attributes:
        model: Innovation form.
        polynomials: A, B, C, D, F; None for state-space methods.
        parameters: Estimated parameters (p,).
        parameter_names: One name per parameter.
        covariance: Of the parameters (p, p); NaN where the method does not know it (`n4sid`).
        noise_variance: Unbiased covariance of the innovation (ny, ny).
        residuals: One-step prediction errors of `model` on its own data, the initial state fitted, or zero if the fit
            took it as zero, (N, ny); experiments one after the other. Of a frequency response its errors in standard
            deviations, real and imaginary parts.
        method: Name of the estimator.
        orders: Orders given to the estimator.
        diagnostics: Condition number, iterations, convergence, initial estimates, `warnings` (a tuple of texts), and
            entries of the method.
        data: Description of the data.
        realise: Pure function from parameters to the model; the delta method differentiates it.
    """

    model: StateSpace
    polynomials: Polynomials | None
    parameters: FloatArray
    parameter_names: tuple[str, ...]
    covariance: FloatArray
    noise_variance: FloatArray
    residuals: FloatArray
    method: str
    orders: Mapping[str, Any]
    diagnostics: Mapping[str, Any]
    data: DataSummary
    realise: Callable[[FloatArray], StateSpace]

    def __post_init__(self) -> None:
        """Check shapes; lock arrays and copies of the mappings."""
        p = len(self.parameters)
        if self.covariance.shape != (p, p) or len(self.parameter_names) != p:
            raise SysidError(
                f"{p} parameters need {p} names and a {p} x {p} covariance, got {len(self.parameter_names)} and "
                f"{self.covariance.shape}"
            )
        super().__post_init__()
        for attribute in ("orders", "diagnostics"):
            copied = {name: _copied(value) for name, value in getattr(self, attribute).items()}
            object.__setattr__(self, attribute, locked_within(copied))

    def __repr__(self) -> str:
        """The first line of the text."""
        return f"<Estimate: {self._heading()}>"

    def _heading(self) -> str:
        """Method, orders and data, in a line."""
        orders = ", ".join(f"{name} {value}" for name, value in self.orders.items())
        same = math.isclose(self.model.dt, self.data.dt, rel_tol=1e-9)
        interval = "" if same else f", converted to every {self.model.dt:g} s"
        return f"{self.method.upper()} ({orders}) from {self.data.extent}{interval}"

    def _parts(self) -> list[Part]:
        """Heading, parameters, dynamics and measures of fit, for the printed text."""
        paragraphs: list[Part] = [self._heading(), *self._parameter_paragraphs(), *self._dynamics()]
        if self.data.frequencies:
            squares = self.diagnostics["sum_of_squares"]
            expected = self.diagnostics["expected_sum_of_squares"]
            comparison = f", {expected:.4g} expected of a true model" if np.isfinite(expected) else ""
            paragraphs.append(f"weighted sum of squares: {squares:.4g}{comparison}")
        else:
            fits = self.fit_percent
            if np.isfinite(fits).all():
                listed_fits = ", ".join(f"{fit:.2f} %" for fit in fits)
                paragraphs.append(f"fit to these data one step ahead: {listed_fits}")
            paragraphs += repetition_in_words(self.diagnostics)
            if not self._shows_matrices:
                variances = ", ".join(numbers(np.diag(self.noise_variance)))
                paragraphs.append(f"innovation variance: {variances}")
        paragraphs.append(f"final prediction error: {self.fpe:.4g}, AIC {self.aic:.6g}, BIC {self.bic:.6g}")
        paragraphs += [f"warning: {message}" for message in self.diagnostics.get("warnings", ())]
        return paragraphs

    def _parameter_paragraphs(self) -> list[Part]:
        """Paragraphs on the parameters: as matrices, as a table with deviations, or as polynomials if they are many."""
        if self._shows_matrices:
            return self._responding.matrices()
        if self._is_fir or len(self.parameters) <= LISTED:
            values = uncertain(self.parameters, self._parameter_deviations())
            return [Table([("parameter", self.parameter_names), ("value", values)])]
        return [
            str(self.polynomials or ""),
            f"{len(self.parameters)} parameters, with deviations: to_dataframe()",
        ]

    @property
    def _shows_matrices(self) -> bool:
        """Whether matrices tell more than the parameters, as those of local coordinates, which mean nothing alone."""
        has_local_coordinates = self.parameter_names[:1] == ("local1",)
        return has_local_coordinates or (self.polynomials is None and self._responding is self.model)

    def _parameter_deviations(self) -> FloatArray:
        """Standard deviation of every parameter (p,)."""
        # rounding may leave a small negative variance
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def _is_fir(self) -> bool:
        """Whether the estimate is a finite impulse response alone."""
        p = self.polynomials
        if p is None or self.model.order == 0:
            return False
        return not any(polynomial[..., 1:].any() for polynomial in (p.A, p.C, p.D, p.F))

    def _dynamics(self) -> Sequence[Part]:
        """Paragraphs on the poles, for the printed text."""
        poles = self.poles()
        if self._is_fir:
            return [f"finite impulse response of {counted(len(poles) + 1, 'sample')}"]
        path = "from input to output" if self.model.nu else "from innovation to output"
        if not len(poles):
            return [f"no poles {path}"]
        return [f"poles {path}:", poles_table(poles, self.model.dt)]

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        deviation = self._parameter_deviations()
        reach = NORMAL_95 * deviation
        values = {"value": self.parameters, "deviation": deviation}
        values |= {"low": self.parameters - reach, "high": self.parameters + reach}
        arrays = {name: ("parameter", array) for name, array in values.items()}
        return arrays, {"parameter": list(self.parameter_names)}, {"method": self.method}

    @property
    def _responding(self) -> "StateSpace | ContinuousModel":
        """The model whose frequency response and bandwidth are reported."""
        return self.model

    def _response_of(self, theta: FloatArray) -> "StateSpace | ContinuousModel":
        """The model at other parameters whose frequency response and bandwidth are reported."""
        return self.realise(theta)

    def poles(self) -> ComplexArray:
        """Poles of the path from input to output, largest modulus first; with intervals: `poles_band`."""
        return self.model.input_path().poles()

    def zeros(self) -> ComplexArray:
        """Transmission zeros of the path from input to output, largest modulus first; with intervals: `zeros_band`."""
        return self.model.input_path().zeros()

    @property
    def operating_point(self) -> tuple[FloatArray, FloatArray] | None:
        """Inputs (nu,) and outputs (ny,) that the signals of the model are relative to; None without such a point."""
        inputs, outputs = self.data.input_offset, self.data.output_offset
        return None if inputs is None or outputs is None else (np.array(inputs), np.array(outputs))

    def to_control(self) -> "control.StateSpace":
        """The path from u to y as a python-control system, with names and sampling interval; see `StateSpace`."""
        return self.model.input_path().to_control()

    def dc_gain(self) -> FloatArray:
        """Gain at 0 Hz (ny, nu); `band`, in continuous time `continuous_band`, gives its interval."""
        return self._responding.dc_gain()

    def step_response(self, n: int) -> FloatArray:
        """Response to a unit step in each input (n, ny, nu); with its interval: `band`."""
        return self.model.step_response(n)

    @property
    def fit_percent(self) -> FloatArray:
        """Fit in percent of the one-step prediction to the data of the fit (ny,); NaN if not known.

        It is that of `compare`, initialisation window included.
        """
        spread = np.array(self.data.output_deviation or [np.nan] * self.model.ny)
        squares = np.nansum(self.residuals**2, axis=0)
        counts = np.isfinite(self.residuals).sum(axis=0)
        # a constant output has no deviation, a lost one no samples
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(100.0 * (1.0 - np.sqrt(squares / counts) / spread))

    @property
    def loss(self) -> float:
        """Mean square of the residuals; with several outputs the ny-th root of the determinant of their covariance."""
        # a sample with a missing output says nothing of the covariance between outputs
        return mean_square(self.residuals[np.isfinite(self.residuals).all(axis=1)])

    @property
    def fpe(self) -> float:
        """Akaike's final prediction error, loss (1 + s) / (1 - s) with s = p / (N ny); infinite for s >= 1.

        With several outputs it is the ny-th root of det(R) ((1 + s) / (1 - s))^ny, R the covariance of the residuals
        [Ljung1999, sec. 16.4; Akaike1971].
        """
        share = self._parameters_per_sample / self.residuals.shape[1]
        return self.loss * (1.0 + share) / (1.0 - share) if share < 1.0 else np.inf

    @property
    def aic(self) -> float:
        """Akaike's information criterion per sample, log det(R) + 2 p/N; comparable on the same data.

        R is the covariance of the residuals, log det(R) = ny log(loss): up to a constant, -2/N times the logarithm of
        the likelihood for normal innovations [Ljung1999, sec. 16.4].
        """
        return self._log_determinant + 2.0 * self._parameters_per_sample

    @property
    def bic(self) -> float:
        """Schwarz's criterion per sample, log det(R) + p log(N)/N, R as for `aic` [Schwarz1978]."""
        return self._log_determinant + float(np.log(sum(self.data.samples)) * self._parameters_per_sample)

    @property
    def _log_determinant(self) -> float:
        """Logarithm of the determinant of the residuals' covariance; minus infinity of a perfect fit."""
        return float(self.residuals.shape[1] * np.log(self.loss)) if self.loss else -np.inf

    @property
    def _parameters_per_sample(self) -> float:
        """Number of free parameters divided by that of samples; a prior leaves fewer of them free."""
        free = self.diagnostics.get("effective_parameters", len(self.parameters))
        return float(free) / sum(self.data.samples)

    def bandwidth(self) -> Bandwidth:
        """Half-power bandwidth with its 95 % interval, by the delta method on its logarithm.

        The crossing moves by d(log f) = -d(log ratio) / (d log ratio / d log f), ratio = |G(f)|^2 / |G(0)|^2, so that
        the crossing is solved for only once [Ljung1999, ch. 9]. The interval ends at the Nyquist frequency at most.

        Warns:
            SysidWarning: A bandwidth uncertain by more than a factor of a thousand, as that of a model close to an
                integrator.
        """
        hz = self._responding.bandwidth()
        _, moves = self._moves(np.zeros(0), hz)
        return self._bandwidth(hz, moves)

    def frequency_response(self, f_hz: ArrayLike) -> FrequencyResponse:
        """Response at frequencies in Hz (nf,), its covariance by the delta method, and the disturbance spectrum."""
        f = frequency_list(f_hz)
        moves, _ = self._moves(f, np.full((self.model.ny, self.model.nu), np.nan))
        return self._frequency_response(f, moves)

    def spectrum(self, f_hz: ArrayLike) -> FrequencyResponse:
        """As `frequency_response`, with the uncertainty of the disturbance's spectrum.

        To first order the parameters and the innovation variance are independent; the latter has the variance of a
        sample covariance of normal innovations [Ljung1999, ch. 9].
        """
        f = frequency_list(f_hz)
        innovation = self.noise_variance

        def log_power(theta: FloatArray) -> FloatArray:
            h = self.realise(theta).noise_response(f)
            power = np.einsum("fik,kl,fil->fi", h, innovation, h.conj()).real
            # rounding may make the power at a zero on the unit circle negative
            return np.log(np.maximum(power, np.finfo(float).tiny))

        response = self.frequency_response(f)
        moves = spread(log_power, self.parameters, self.covariance)
        h = self.model.noise_response(f)
        power = np.einsum("fik,kl,fil->fi", h, innovation, h.conj())
        pseudo_power = np.einsum("fik,kl,fil->fi", h, innovation, h)
        # of a complex h, h R h* has between one and two times 1/N of its square as variance
        ratio = np.abs(pseudo_power / np.maximum(power.real, np.finfo(float).tiny))
        variance = (1.0 + ratio**2) / len(self.residuals)
        return replace(response, noise_deviation=np.sqrt(np.sum(moves**2, axis=0) + variance))

    def response_and_bandwidth(self, f_hz: ArrayLike) -> tuple[FrequencyResponse, Bandwidth]:
        """`frequency_response` and `bandwidth` at once, in half the time where models take long to realise.

        Warns:
            SysidWarning: As `bandwidth` does.
        """
        f = frequency_list(f_hz)
        hz = self._responding.bandwidth()
        of_response, of_ratios = self._moves(f, hz)
        return self._frequency_response(f, of_response), self._bandwidth(hz, of_ratios)

    def _moves(self, f: FloatArray, hz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Changes of response and bandwidth per standard direction of the parameters.

        Each perturbed model is realised only once for both. The first are those of real and imaginary part of the
        response at `f` (p, nf, ny, nu, 2), the second those of log(|G(hz)|^2 / |G(0)|^2) (p, m), one for each finite
        bandwidth in `hz` (ny, nu).
        """
        shape = (len(f), self.model.ny, self.model.nu, 2)
        entries_of_response = math.prod(shape)
        i, j = np.nonzero(np.isfinite(hz))
        # the asked frequencies, then the bandwidths, then 0 Hz where there is a bandwidth to compare with it
        at = np.concatenate((f, hz[i, j], np.zeros(min(len(i), 1))))
        bandwidth_rows = len(f) + np.arange(len(i))

        def response_and_ratios(theta: FloatArray) -> FloatArray:
            g = self._response_of(theta).frequency_response(at)
            ratios = np.zeros(0)
            if len(i):
                ratios = _log_ratio(g[bandwidth_rows, i, j], g[-1, i, j])
            response = np.stack((g.real, g.imag), axis=-1)[: len(f)]
            return np.concatenate((response.ravel(), ratios))

        moves = spread(response_and_ratios, self.parameters, self.covariance)
        moves = moves.reshape(len(moves), entries_of_response + len(i))
        of_response = moves[:, :entries_of_response].reshape(len(moves), *shape)
        return of_response, moves[:, entries_of_response:]

    def _bandwidth(self, hz: FloatArray, moves: FloatArray) -> Bandwidth:
        """Bandwidths with intervals from the changes of log(|G(hz)|^2 / |G(0)|^2) per standard direction (p, m)."""
        deviation = np.full(hz.shape, np.nan)
        nyquist = 0.5 / self.model.dt
        for (i, j), move in zip(np.argwhere(np.isfinite(hz)), moves.T, strict=True):
            # not beyond Nyquist, where the response repeats
            upper, lower = min(hz[i, j] * (1 + SLOPE_STEP), nyquist), hz[i, j] * (1 - SLOPE_STEP)
            above, below, dc = self._responding.frequency_response([upper, lower, 0.0])[:, i, j]
            slope = (_log_ratio(above, dc) - _log_ratio(below, dc)) / np.log(upper / lower)
            # a gain that is flat there does not determine the crossing
            deviation[i, j] = np.linalg.norm(move) / abs(slope) if slope else np.inf
        vague = deviation > VAGUE
        if vague.any():
            warnings.warn(
                "the bandwidth is not determined, since the model hardly differs from an integrator: its logarithm has "
                f"the standard deviation {np.nanmax(deviation):.3g}, and its interval is 0 to Nyquist",
                SysidWarning,
                stacklevel=3,
            )
        # the ends of vague ones do not follow from the factor, which must not overflow
        factor = np.exp(NORMAL_95 * np.minimum(deviation, VAGUE))
        low = np.where(vague, 0.0, hz / factor)
        high = np.where(vague, nyquist, np.minimum(hz * factor, nyquist))
        return Bandwidth(hz, (low, high))

    def _frequency_response(self, f: FloatArray, moves: FloatArray) -> FrequencyResponse:
        """Response at `f` with its covariance from changes per standard direction (p, nf, ny, nu, 2)."""
        # white noise of covariance R has the two-sided density dt R
        h = self._responding.noise_response(f)
        noise = self.model.dt * h @ self.noise_variance @ h.conj().transpose(0, 2, 1)
        covariance = None
        if np.isfinite(self.covariance).all():
            covariance = np.einsum("k...i,k...j->...ij", moves, moves)
        spectrum = noise if np.isfinite(noise).all() else None
        return FrequencyResponse(
            frequencies=f,
            response=self._responding.frequency_response(f),
            dt=self.model.dt,
            method=self.method,
            covariance=covariance,
            noise_spectrum=spectrum,
            input_names=self.data.input_names,
            output_names=self.data.output_names,
        )


def mean_square(errors: FloatArray) -> float:
    """Mean square of errors (N, ny); with several outputs the ny-th root of the determinant of their covariance."""
    sign, logarithm = np.linalg.slogdet(errors.T @ errors / len(errors))
    # the determinant itself would underflow with many outputs of small unit
    return 0.0 if sign <= 0.0 else math.exp(logarithm / errors.shape[1])


def _copied(value: Any) -> Any:
    """Copy arrays, and lists into tuples: the caller may change its own."""
    if isinstance(value, np.ndarray):
        return value.copy()
    # not isinstance: a named tuple must stay one
    if type(value) in (tuple, list):
        return tuple(_copied(item) for item in value)
    return value


def repetition_in_words(diagnostics: Mapping[str, Any]) -> list[str]:
    """What repeats with the input, where it made the intervals of an estimate wider; empty elsewhere."""
    periods = diagnostics.get("periods")
    if periods is None:
        return []
    sequences = counted(diagnostics["sequences"], "sequence")
    share = 100.0 * diagnostics["repeated_share"]
    return [
        f"{periods} periods of {sequences}: {share:.0f} % of the errors' power repeats with the input, and the "
        "intervals count it once"
    ]


def as_estimate(estimate: Estimate) -> Estimate:
    """Check that the argument is an estimate: a model alone has no uncertainty."""
    if not isinstance(estimate, Estimate):
        raise SysidError(
            f"expected an Estimate, got {type(estimate).__name__}: intervals rest on the covariance of its parameters"
        )
    return estimate


def _log_ratio(g: ComplexArray, dc: ComplexArray) -> FloatArray:
    """Logarithm of |G|^2 / |G(0)|^2."""
    return np.asarray(2.0 * np.log(np.abs(g) / np.abs(dc)))

"""Linear models in continuous time, with a delay of each path."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.half_power import half_power_frequencies
from sysid.models.sampling import sample
from sysid.models.state_space import StateSpace
from sysid.models.system_matrices import transmission_zeros
from sysid.records.arguments import frequency_list, sampling_interval
from sysid.records.arrays import ComplexArray, FloatArray, Locked, real_array
from sysid.records.errors import SysidError
from sysid.records.optional import optional
from sysid.records.printing import LISTED, Part

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False, repr=False)
class ContinuousModel(Locked):
    """Continuous-time model x' = A x + B u + K e, y = C x + D u + e, every path from u to y delayed.

    Attributes:
        states: A, B, C, D and K in a container that checks them; its `dt` is the sampling interval in s of the data,
            which limits the frequencies that the model describes, and its innovation covariance that of sampled data:
            the spectral density of e is dt times as large.
        delays: Delay in s of each path (ny, nu).
        intersample: Behaviour of the input between samples, held (`zoh`) or linear (`foh`).

    Raises:
        SysidError: Delays that do not fit the channels or are negative.
    """

    states: StateSpace
    delays: FloatArray
    intersample: str = "zoh"

    def __post_init__(self) -> None:
        """Check and lock."""
        delays, shape = real_array("delays", self.delays), self.states.D.shape
        if delays.shape != shape or (delays < 0.0).any():
            raise SysidError(f"delays: expected {shape} values >= 0 s, one per path, got {delays.tolist()}")
        super().__post_init__()

    def _parts(self) -> list[Part]:
        return [f"Continuous-time model of order {self.order}", *self.fractions()]

    def matrices(self) -> list[Part]:
        """As those of `StateSpace`; inputs without their delays."""
        _, *tables = self.states.matrices()
        state_noise, output_noise = (" + K e", " + e") if self.states.gain.any() else ("", "")
        return [f"x' = A x + B u{state_noise}, y = C x + D u{output_noise}", *tables]

    def fractions(self) -> list[str]:
        """Transfer function of each path, as text."""
        input_names, output_names = self.states.input_names or (), self.states.output_names or ()
        paths = list(np.ndindex(self.delays.shape))
        lines = []
        for i, j in paths[:LISTED]:
            fraction = _fraction(*self.path(j, i))
            lines.append(f"{input_names[j]} to {output_names[i]}: {fraction}")
        if len(paths) > LISTED:
            lines.append(f"... {len(paths)} paths")
        return lines

    @property
    def order(self) -> int:
        """Number of states n."""
        return self.states.order

    def poles(self) -> ComplexArray:
        """Poles of the path from u to y in rad/s, largest modulus first."""
        return self.states.input_path().poles()

    def zeros(self) -> ComplexArray:
        """Finite transmission zeros in rad/s of the path from u to y without delays, largest modulus first."""
        return self.states.input_path().zeros()

    def frequency_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response at s = 2 pi i f of frequencies in Hz (nf,), delays included (nf, ny, nu)."""
        s = np.atleast_1d(2j * np.pi * frequency_list(f_hz))
        undelayed = self.states.transfer(s, self.states.B, self.states.D)
        return undelayed * np.exp(-s[:, None, None] * self.delays)

    def noise_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response from e to the output (nf, ny, ny)."""
        s = np.atleast_1d(2j * np.pi * frequency_list(f_hz))
        return self.states.transfer(s, self.states.gain, np.eye(self.states.ny))

    def dc_gain(self) -> FloatArray:
        """Response at 0 Hz (ny, nu); infinite where the model integrates."""
        m = self.states
        try:
            return m.D - m.C @ np.linalg.solve(m.A, m.B)
        except np.linalg.LinAlgError:
            # a pole at exactly zero
            return np.full(self.delays.shape, np.inf)

    def bandwidth(self) -> FloatArray:
        """First frequency in Hz, up to Nyquist of the data, where the gain is 3.01 dB below that at 0 Hz (ny, nu)."""
        return half_power_frequencies(self, self.sampled().search_grid())

    def channel(self, input: int, output: int) -> "ContinuousModel":
        """The path from one input to one output, without noise model and names."""
        return replace(self, states=self.states.channel(input, output), delays=self.delays[[output]][:, [input]])

    def path(self, input: int = 0, output: int = 0) -> tuple[FloatArray, FloatArray, float]:
        """Numerator and denominator of falling powers of s, the denominator monic, and the delay in s of one path."""
        m = self.states.channel(input, output).input_path()
        denominator = np.atleast_1d(np.poly(m.A).real) if m.order else np.ones(1)
        zeros = transmission_zeros(m.A, m.B, m.C, m.D)
        relative = m.order - len(zeros)
        # the first derivative of the impulse response that is not zero: C A^(r-1) B for the relative degree r
        leading = m.C @ np.linalg.matrix_power(m.A, relative - 1) @ m.B if relative else m.D
        return leading[0, 0] * np.atleast_1d(np.poly(zeros).real), denominator, float(self.delays[output, input])

    def sampled(self, dt: float | None = None) -> StateSpace:
        """Discrete-time model with the same outputs at the samples, for the input between samples of `intersample`.

        The noise e is taken as held, with its spectral density at low frequencies kept.

        Args:
            dt: Sampling interval in s; that of the data by default.
        """
        dt = self.states.dt if dt is None else sampling_interval(dt)
        # outputs that share their delays share states too; the others need the dynamics once each
        groups = [[i] for i in range(len(self.delays))]
        if (self.delays == self.delays[0]).all():
            groups = [list(range(len(self.delays)))]
        sampled_groups = [self._sampled_outputs(dt, outputs) for outputs in groups]
        A_blocks, B_blocks, C_blocks, D_blocks, K_blocks = zip(*sampled_groups, strict=True)
        K = np.vstack(K_blocks)
        covariance = self.states.innovation_covariance
        # the spectral density of the noise is kept, so that its variance grows with the sampling frequency
        covariance = None if covariance is None else covariance * (self.states.dt / dt)
        return replace(
            self.states,
            A=scipy.linalg.block_diag(*A_blocks),
            B=np.vstack(B_blocks),
            C=scipy.linalg.block_diag(*C_blocks),
            D=np.vstack(D_blocks),
            K=K if K.any() else None,
            dt=dt,
            innovation_covariance=covariance,
        )

    def _sampled_outputs(self, dt: float, rows: list[int]) -> tuple[FloatArray, ...]:
        """A, B, C, D and K of the sampled paths to outputs that share the delay of each input."""
        m = self.states
        if len(rows) < m.ny:
            m = StateSpace(m.A, m.B, m.C[rows], m.D[rows], None, m.dt).input_path()
        nu, n = m.nu, m.order
        noise = sample(m.A, m.gain, dt)
        taps = []
        for j in range(nu):
            taps.append(sample(m.A, m.B[:, [j]], dt, self.delays[rows[0], j], self.intersample))
        longest_lags = [max((0, *tap.gamma, *tap.weights)) for tap in taps]
        size = n + sum(longest_lags)
        A, B, C, D = np.zeros((size, size)), np.zeros((size, nu)), np.zeros((m.ny, size)), np.zeros((m.ny, nu))
        A[:n, :n], C[:, :n] = noise.phi, m.C
        jumps = np.zeros((n, nu))
        first = n
        for j, (tap, length) in enumerate(zip(taps, longest_lags, strict=True)):
            # past inputs are states: u(k - 1), ..., u(k - length)
            if length:
                B[first, j] = 1.0
                A[first + 1 : first + length, first : first + length - 1] = np.eye(length - 1)
            for lag, gamma in tap.gamma.items():
                if lag == -1:
                    jumps[:, [j]] = gamma
                elif lag == 0:
                    B[:n, [j]] += gamma
                else:
                    A[:n, [first + lag - 1]] += gamma
            for lag, weight in tap.weights.items():
                if lag == 0:
                    D[:, j] += weight * m.D[:, j]
                else:
                    C[:, first + lag - 1] += weight * m.D[:, j]
            first += length
        # x(k) - jumps u(k) as state: u(k + 1) no longer acts on it
        B[:n] += noise.phi @ jumps
        D += m.C @ jumps
        gain = noise.gamma[0]
        K = np.vstack((gain, np.zeros((size - n, gain.shape[1]))))
        return A, B, C, D, K

    def to_control(self, pade: int | None = None) -> "control.StateSpace":
        """The path from u to y as a python-control system.

        Args:
            pade: Order of the Padé approximation of delays, which python-control does not have.

        Raises:
            SysidError: Delays without an order of their approximation, or that differ between outputs.
        """
        with optional("control"):
            import control

        m = self.states
        labels = {"inputs": list(m.input_names or ()), "outputs": list(m.output_names or ())}
        system = control.ss(m.A, m.B, m.C, m.D, 0)
        if self.delays.any():
            if pade is None or (self.delays != self.delays[0]).any():
                raise SysidError(
                    f"python-control has no delays, the model has {self.delays.tolist()} s: pade=N approximates those "
                    "that all outputs share, .channel(input, output) picks a path"
                )
            approximations = []
            for delay in self.delays[0]:
                numerator, denominator = control.pade(float(delay), pade)
                approximations.append(control.ss(control.tf(numerator, denominator)))
            system = control.series(control.append(*approximations), system)
        return control.ss(system.A, system.B, system.C, system.D, 0, **labels)


def _fraction(numerator: FloatArray, denominator: FloatArray, delay: float) -> str:
    """Transfer function of a path, as text."""
    delay_factor = f"exp(-{delay:.4g} s) " if delay else ""
    return delay_factor + f"({polynomial_text(numerator)}) / ({polynomial_text(denominator)})"


def polynomial_text(coefficients: FloatArray) -> str:
    """A polynomial in s, such as "s^2 + 0.5 s + 4", coefficients of falling powers."""
    degree = len(coefficients) - 1
    terms = [_term(c, degree - k) for k, c in enumerate(coefficients) if c]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _term(coefficient: float, power: int) -> str:
    """Text of c s^k: a constant without s, a factor of one left out."""
    if power == 0:
        return f"{coefficient:.5g}"
    symbol = f"s^{power}" if power > 1 else "s"
    return symbol if coefficient == 1.0 else f"{coefficient:.5g} {symbol}"

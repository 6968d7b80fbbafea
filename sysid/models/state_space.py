"""Linear state-space models in innovation form."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.half_power import half_power_frequencies
from sysid.models.system_matrices import balanced_truncation, schur_form, transmission_zeros
from sysid.records.arguments import (
    frequency_list,
    real_number,
    sampling_interval,
    shown,
    warn_beyond_nyquist,
    whole_number,
)
from sysid.records.arrays import ComplexArray, FloatArray, Locked, lock, real_array
from sysid.records.channels import channel_labels, default_names
from sysid.records.errors import SysidError
from sysid.records.optional import optional
from sysid.records.printing import Part, matrix_table, poles_table

if TYPE_CHECKING:
    import control

LARGE = 24  # order from which one Schur decomposition for all frequencies is faster than a linear solve at each

ON_A_POLE = "a frequency falls exactly on a pole on the unit circle: the response is infinite"


LONGEST_RESPONSE = 10**8  # samples of a pulse response


@dataclass(frozen=True, eq=False, repr=False)
class StateSpace(Locked):
    """Discrete-time model x(t+1) = A x + B u + K e, y(t) = C x + D u + e [Ljung1999, sec. 4.3].

    Attributes:
        A: State matrix (n, n); n may be 0.
        B: Input matrix (n, nu).
        C: Output matrix (ny, n).
        D: Direct term (ny, nu).
        K: Innovation gain (n, ny); None means zero: the model has no dynamics of the noise.
        dt: Sampling interval in s.
        innovation_covariance: Covariance of e (ny, ny), in output units squared; None if unknown.
        input_names: One name per input.
        output_names: One name per output.
        input_units: One unit per input.
        output_units: One unit per output.

    Raises:
        SysidError: Matrices of incompatible shapes, `dt <= 0`, NaN, an invalid covariance.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    K: FloatArray | None
    dt: float
    innovation_covariance: FloatArray | None = None
    input_names: tuple[str, ...] | None = field(default=None, kw_only=True)
    output_names: tuple[str, ...] | None = field(default=None, kw_only=True)
    input_units: tuple[str, ...] | None = field(default=None, kw_only=True)
    output_units: tuple[str, ...] | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        """Check and lock."""
        D = np.atleast_2d(real_array("D", self.D))
        ny, nu = D.shape[:2]
        A = real_array("A", self.A)
        A = A.reshape(0, 0) if A.size == 0 else np.atleast_2d(A)
        n = len(A)
        K = np.zeros((n, ny)) if self.K is None else real_array("K", self.K)
        matrices_and_shapes = {
            "A": (A, (n, n)),
            "D": (D, (ny, nu)),
            "B": (real_array("B", self.B), (n, nu)),
            "C": (real_array("C", self.C), (ny, n)),
            "K": (K, (n, ny)),
        }
        if self.innovation_covariance is not None:
            covariance = np.atleast_2d(real_array("innovation_covariance", self.innovation_covariance))
            matrices_and_shapes["innovation_covariance"] = (covariance, (ny, ny))
            if covariance.shape == (ny, ny) and not is_covariance(covariance):
                raise SysidError(
                    f"innovation_covariance must be symmetric without negative eigenvalues, got "
                    f"{shown(covariance.tolist())}"
                )
        for attribute, (matrix, shape) in matrices_and_shapes.items():
            # an empty matrix may come as [], with one axis
            shaped = matrix.reshape(shape) if matrix.size == 0 == np.prod(shape) else matrix
            if shaped.shape != shape:
                raise SysidError(
                    f"{attribute}: expected shape {shape} for {n} states, {nu} inputs, {ny} outputs, got {matrix.shape}"
                )
            object.__setattr__(self, attribute, lock(shaped))
        object.__setattr__(self, "dt", sampling_interval(self.dt))
        default_labels = {
            "input_names": default_names("u", nu),
            "output_names": default_names("y", ny),
            "input_units": ("",) * nu,
            "output_units": ("",) * ny,
        }
        for attribute, default in default_labels.items():
            labels = channel_labels(attribute, getattr(self, attribute), default)
            object.__setattr__(self, attribute, labels)

    def _parts(self) -> list[Part]:
        """Heading, matrices and poles, for the printed text."""
        poles = [poles_table(self.poles(), self.dt)] if self.order else []
        return [f"State space of order {self.order}, sampled every {self.dt:g} s", *self.matrices(), *poles]

    def matrices(self) -> list[Part]:
        """Equations, tables of A, B, C, D, and of K and the innovation covariance where there are any, with names."""
        has_noise = self.gain.any()
        state_input, output_input = (" + B u", " + D u") if self.nu else ("", "")
        state_noise, output_noise = (" + K e", " + e") if has_noise else ("", "")
        equations = f"x(t+1) = A x{state_input}{state_noise}, y = C x{output_input}{output_noise}"
        x, u, y = default_names("x", self.order), self.input_names or (), self.output_names or ()
        matrices = [("A", self.A, x, x), ("B", self.B, x, u), ("C", self.C, y, x), ("D", self.D, y, u)]
        if has_noise:
            matrices.append(("K", self.gain, x, y))
        if self.innovation_covariance is not None:
            matrices.append(("covariance of e", self.innovation_covariance, y, y))
        tables = [matrix_table(name, M, rows, columns) for name, M, rows, columns in matrices if M.size]
        return [equations, *tables]

    @property
    def order(self) -> int:
        """Number of states n."""
        return int(self.A.shape[0])

    @property
    def nu(self) -> int:
        """Number of inputs."""
        return int(self.D.shape[1])

    @property
    def ny(self) -> int:
        """Number of outputs."""
        return int(self.D.shape[0])

    @property
    def gain(self) -> FloatArray:
        """Innovation gain K (n, ny), zero if K is None."""
        return np.zeros((self.order, self.ny)) if self.K is None else self.K

    def poles(self) -> ComplexArray:
        """Eigenvalues of A (n,), largest modulus first."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return values[np.argsort(-np.abs(values), kind="stable")]

    def zeros(self) -> ComplexArray:
        """Finite transmission zeros: where the system matrix [A - zI, B; C, D] loses rank."""
        return transmission_zeros(self.A, self.B, self.C, self.D)

    def is_stable(self) -> bool:
        """Whether every pole lies strictly inside the unit circle."""
        return bool((np.abs(self.poles()) < 1.0).all())

    def frequency_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response C (zI - A)^-1 B + D at z = exp(2 pi i f dt).

        Args:
            f_hz: Frequencies in Hz (nf,); a warning if above Nyquist.

        Returns:
            Complex response (nf, ny, nu), in output units per input unit.
        """
        warn_beyond_nyquist(f_hz, self.dt)
        return self._response(f_hz, self.B, self.D)

    def noise_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response C (zI - A)^-1 K + I from the innovation to the output (nf, ny, ny)."""
        return self._response(f_hz, self.gain, np.eye(self.ny))

    def _response(self, f_hz: ArrayLike, B: FloatArray, D: FloatArray) -> ComplexArray:
        """C (zI - A)^-1 B + D at frequencies in Hz (nf,), for any B and D that fit the states."""
        return self.transfer(np.exp(2j * np.pi * self.dt * frequency_list(f_hz)), B, D)

    def transfer(self, z: ComplexArray, B: FloatArray, D: FloatArray) -> ComplexArray:
        """C (zI - A)^-1 B + D at complex points z (nf,), for any B and D that fit the states, (nf, ny, columns).

        Raises:
            SysidError: A pole at one of the points.
        """
        if self.order == 0:
            return np.broadcast_to(D.astype(complex), (len(z), *D.shape)).copy()
        if self.order > LARGE:
            return self._response_of_many_states(z, B, D)
        pencil = z[:, None, None] * np.eye(self.order) - self.A
        drive = np.broadcast_to(B.astype(complex), (len(z), *B.shape))
        try:
            states = np.linalg.solve(pencil, drive)
        except np.linalg.LinAlgError as error:
            raise SysidError(ON_A_POLE) from error
        return np.asarray(self.C @ states + D, dtype=np.complex128)

    def _response_of_many_states(self, z: ComplexArray, B: FloatArray, D: FloatArray) -> ComplexArray:
        """C (zI - A)^-1 B + D by one Schur decomposition and one back substitution for all frequencies."""
        # by its bytes, as arrays cannot be keys of a cache
        triangle, basis = schur_form(self.A.tobytes(), self.order)
        drive = basis.conj().T @ B
        states = np.zeros((self.order, len(z) * B.shape[1]), dtype=complex)
        for i in range(self.order - 1, -1, -1):
            distance = z - triangle[i, i]
            if not distance.all():
                raise SysidError(ON_A_POLE)
            forced = (triangle[i, i + 1 :] @ states[i + 1 :]).reshape(len(z), B.shape[1]) + drive[i]
            states[i] = (forced / distance[:, None]).ravel()
        response = (self.C @ basis @ states).reshape(self.ny, len(z), B.shape[1])
        return np.asarray(np.moveaxis(response, 0, 1) + D, dtype=np.complex128)

    def dc_gain(self) -> FloatArray:
        """Response at 0 Hz (ny, nu); infinite where the model integrates."""
        try:
            return self.C @ np.linalg.solve(np.eye(self.order) - self.A, self.B) + self.D
        except np.linalg.LinAlgError:
            return np.full((self.ny, self.nu), np.inf)

    def bandwidth(self) -> FloatArray:
        """First frequency in Hz where the magnitude has fallen to 1/sqrt(2) (-3.0103 dB) of that at 0 Hz.

        The search grid is logarithmic, linear, and dense around every pole, so that no crossing of a sharp resonance is
        missed; the crossing is then solved for.

        Returns:
            Bandwidths (ny, nu); NaN if the response does not fall to that level below the Nyquist frequency, or if the
            gain at 0 Hz is zero or infinite.
        """
        return half_power_frequencies(self, self.search_grid())

    def search_grid(self) -> FloatArray:
        """Frequencies up to Nyquist in Hz, logarithmic, linear, and dense around every pole."""
        nyquist = 0.5 / self.dt
        grids = [np.geomspace(1e-7 * nyquist, nyquist, 1200), np.linspace(0.0, nyquist, 801)[1:]]
        poles = self.poles()
        # a pole at zero is a delay, one far outside the circle no resonance: neither bends the gain at a frequency
        poles = poles[(np.abs(poles) > 1e-12) & (np.abs(poles) < 1.5)]
        for pole in poles:
            s = np.log(pole) / (2 * np.pi * self.dt)
            # the width of a resonance is the real part of its pole; one on the circle needs a least width
            width = max(abs(s.real), 1e-6 * nyquist)
            grids.append(abs(s.imag) + width * np.linspace(-4.0, 4.0, 41))
        grid = np.unique(np.concatenate(grids))
        return grid[(grid > 0.0) & (grid <= nyquist)]

    def markov(self, n: int) -> FloatArray:
        """First n Markov parameters D, CB, CAB, ... (n, ny, nu): the pulse response, sample by sample.

        Raises:
            SysidError: n < 1, or more samples than memory holds.
        """
        n = whole_number("n", n, 1, LONGEST_RESPONSE)
        out = np.empty((n, self.ny, self.nu))
        out[0] = self.D
        state = self.B
        for k in range(1, n):
            out[k] = self.C @ state
            state = self.A @ state
        return out

    def impulse_response(self, n: int) -> FloatArray:
        """Response to a unit pulse in each input (n, ny, nu); the same as `markov`."""
        return self.markov(n)

    def step_response(self, n: int) -> FloatArray:
        """Response to a unit step in each input (n, ny, nu)."""
        return np.cumsum(self.markov(n), axis=0)

    def minimal(self, tolerance: float = 1e-9) -> "StateSpace":
        """Drop nearly uncontrollable or unobservable states by balanced truncation [Moore1981].

        Args:
            tolerance: States with a Hankel singular value below `tolerance` times the largest are dropped.

        Returns:
            A balanced model with the same input-output behaviour, without noise dynamics.

        Raises:
            SysidError: The model is not stable, or has noise dynamics, which the truncation would lose.
        """
        tolerance = real_number("tolerance", tolerance, "lie from 0 to below 1", lambda x: 0.0 <= x < 1.0)
        if np.any(self.gain):
            raise SysidError("minimal reduces the input-output path only, got a model with nonzero K: use balred")
        A, B, C, _ = balanced_truncation(self.A, self.B, self.C, tolerance)
        return replace(self, A=A, B=B, C=C, K=None)

    def channel(self, input: int, output: int) -> "StateSpace":
        """The path from one input to one output, without noise model and names."""
        input = whole_number("input", input, -self.nu, self.nu - 1)
        output = whole_number("output", output, -self.ny, self.ny - 1)
        # lists as indices keep both axes
        B, C, D = self.B[:, [input]], self.C[[output]], self.D[[output]][:, [input]]
        return StateSpace(self.A, B, C, D, None, self.dt)

    def input_path(self) -> "StateSpace":
        """The path from u to y: without noise model, and without states that are structurally decoupled from it.

        These are states that the zeros of A, B and C cut off from all inputs or all outputs, as the noise model of OE
        and Box-Jenkins estimates; there is no tolerance, and the model may be unstable. The path of a time series is
        that from the innovation e to y.
        """
        if self.nu == 0:
            # an innovation is named after its output
            innovations = tuple(f"e@{name}" for name in self.output_names or ())
            without_noise = replace(self, K=None, innovation_covariance=None)
            return replace(
                without_noise,
                B=self.gain,
                D=np.eye(self.ny),
                input_names=innovations,
                input_units=self.output_units,
            )
        coupled = self.A != 0.0
        reached, observed = (self.B != 0.0).any(axis=1), (self.C != 0.0).any(axis=0)
        # n steps of the graph of A reach every state that has a path to it
        for _ in range(self.order):
            reached = reached | coupled[:, reached].any(axis=1)
            observed = observed | coupled[observed].any(axis=0)
        keep = np.flatnonzero(reached & observed)
        A, B, C = self.A[np.ix_(keep, keep)], self.B[keep], self.C[:, keep]
        return replace(self, A=A, B=B, C=C, K=None, innovation_covariance=None)

    def to_control(self) -> "control.StateSpace":
        """The path from u to y as a python-control system; of a time series, that from e to y."""
        # python-control loads matplotlib.pyplot, which takes longer than most analyses.
        with optional("control"):
            import control

        if self.nu == 0:
            return self.input_path().to_control()
        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            self.dt,
            inputs=list(self.input_names or ()),
            outputs=list(self.output_names or ()),
        )

    @staticmethod
    def from_control(system: "control.LTI") -> "StateSpace":
        """Convert a discrete-time python-control system with its signal names; it has no noise model, so K = 0.

        Raises:
            SysidError: The system is continuous or has no sampling interval.
        """
        with optional("control"):
            import control

        if not isinstance(system, control.LTI):
            raise SysidError(f"expected a python-control system, got {type(system).__name__}")
        # realises a transfer function
        ss = control.ss(system)
        # dt = True is python-control's discrete time without an interval
        if not isinstance(ss.dt, float | int) or isinstance(ss.dt, bool) or ss.dt <= 0:
            raise SysidError(f"expected a discrete-time system with a sampling interval, got dt = {ss.dt!r}")
        inputs, outputs = StateSpace.names_of_control(ss)
        return StateSpace(ss.A, ss.B, ss.C, ss.D, None, float(ss.dt), input_names=inputs, output_names=outputs)

    @staticmethod
    def names_of_control(system: "control.LTI") -> tuple[tuple[str, ...] | None, tuple[str, ...] | None]:
        """Names of inputs and outputs of a python-control system; None where they are its defaults."""
        return _user_labels(system.input_labels), _user_labels(system.output_labels)


def is_covariance(matrix: FloatArray) -> bool:
    """Whether a matrix is symmetric without negative eigenvalues, apart from rounding."""
    size = float(np.abs(matrix).max(initial=0.0))
    symmetric = np.abs(matrix - matrix.T).max(initial=0.0) <= 1e-6 * size
    if not symmetric or not matrix.size:
        return bool(symmetric)
    return bool(np.linalg.eigvalsh(matrix)[0] >= -1e-9 * size)


def _user_labels(labels: Sequence[str]) -> tuple[str, ...] | None:
    """The labels, or None if they are python-control's defaults."""
    if any(re.fullmatch(r"[uy]\[\d+\]", label) for label in labels):
        return None
    return tuple(labels)


def block_diagonal(models: Sequence[StateSpace]) -> StateSpace:
    """Append models without coupling, inputs and outputs in order [Morris1996, eq. 4.14].

    Names are kept where they stay unique; otherwise channels are renumbered.

    Args:
        models: State-space models, `estimate.model` of estimates.

    Returns:
        One model with all states, inputs, outputs, noise models and innovation covariances.

    Raises:
        SysidError: No model, something else, or models with different sampling intervals.
    """
    if not models:
        raise SysidError("expected at least one model, got none")
    for m in models:
        if not isinstance(m, StateSpace):
            raise SysidError(f"expected StateSpace models, got {type(m).__name__}; an estimate's is `estimate.model`")
    if not all(np.isclose(m.dt, models[0].dt, rtol=1e-9, atol=0.0) for m in models):
        raise SysidError(f"models must share one sampling interval, got {[m.dt for m in models]} s")
    covariances = [m.innovation_covariance for m in models if m.innovation_covariance is not None]
    covariance = _block_matrix(covariances) if len(covariances) == len(models) else None
    return StateSpace(
        _block_matrix([m.A for m in models]),
        _block_matrix([m.B for m in models]),
        _block_matrix([m.C for m in models]),
        _block_matrix([m.D for m in models]),
        _block_matrix([m.gain for m in models]),
        models[0].dt,
        covariance,
        **_joined_labels(models),
    )


def _block_matrix(matrices: list[FloatArray]) -> FloatArray:
    """Block-diagonal matrix."""
    # scipy's block_diag turns an empty (0, n) block into the right number of columns, but a 1-D one into a row
    return np.asarray(scipy.linalg.block_diag(*matrices), dtype=float)


def _joined_labels(models: Sequence[StateSpace]) -> dict[str, tuple[str, ...] | None]:
    """Names and units of all channels, as keyword arguments of `StateSpace`; None instead of names that repeat."""
    labels: dict[str, tuple[str, ...] | None] = {}
    for attribute in ("input_names", "output_names", "input_units", "output_units"):
        joined: list[str] = []
        for model in models:
            joined += getattr(model, attribute) or ()
        repeats = len(set(joined)) < len(joined)
        labels[attribute] = None if repeats and attribute.endswith("names") else tuple(joined)
    return labels

"""Information of an input about a model, per frequency and of a record of finite length."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.state_space import StateSpace
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import known_estimate
from sysid.records.arguments import real_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd
from sysid.validation.cramer_rao import cramer_rao_bound, pulse_length

Quantity = Callable[[StateSpace], float | FloatArray]

DIED_OUT = 1e-12  # of the response to a pulse
SINGULAR = 1e-12  # ratio of eigenvalues below which the record leaves parameters undetermined
SAME = 1e-9  # ratio of singular values below which nuisances have the same effect


def pilot_of(
    model: Estimate | Polynomials, samples: int, *, dt: float | None, variance: float | None, size: float
) -> Estimate:
    """Check a model; polynomials become an estimate, as uncertain as after a binary input of some length and size.

    Raises:
        SysidError: Another model, several inputs, no covariance, or an unstable model.
    """
    if isinstance(model, Polynomials):
        if dt is None or variance is None:
            raise SysidError("polynomials have no sampling interval and no noise: expected dt and variance as well")
        power = real_number("variance", variance, "be a variance > 0", lambda v: 0.0 < v < np.inf)
        orders = Orders.of(model)
        # 20 samples per parameter at least: a shorter record might not determine them
        length = max(samples, 20 * orders.count)
        bits = np.random.default_rng(0).choice([-size, size], (length, model.nu))
        data = IOData(bits, np.zeros((len(bits), 1)), dt)
        bound = cramer_rao_bound(model, orders, bits, dt=data.dt, variance=power, frequencies=np.zeros(0))
        form = innovations_form(model, data.dt)
        pilot = known_estimate(form, model, orders, bound.covariance, variance=power, data=data)
    elif not isinstance(model, Estimate):
        raise SysidError(f"expected an Estimate, or Polynomials with dt and variance, got {type(model).__name__}")
    elif dt is not None or variance is not None:
        raise SysidError("dt and variance given with an estimate, which has its own: expected neither")
    elif not np.isfinite(model.covariance).all():
        raise SysidError(f"{model.method} gives no covariance of its parameters; refine it by pem_ss")
    elif not np.isfinite(model.noise_variance).all():
        raise SysidError(
            f"{model.method} gives no variance of the disturbance, on which the variance of an estimate rests"
        )
    else:
        pilot = model
    if pilot.model.nu != 1:
        raise SysidError(f"the model has {pilot.model.nu} inputs, expected 1: design them one by one")
    if not pilot.model.is_stable():
        raise SysidError("the model is not stable: no input can be designed for it in open loop")
    return pilot


def transform_length(pilots: Sequence[Estimate], samples: int) -> int:
    """Length of the transforms in which no response of a record wraps around into it."""
    slowest = 0.0
    for pilot in pilots:
        m = pilot.model
        # of the model and of its whitening filter
        for matrix in (m.A, m.A - m.gain @ m.C):
            slowest = max(slowest, float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0)))
    return int(scipy.fft.next_fast_len(samples + pulse_length(slowest, DIED_OUT), real=True))


def _derivatives(pilot: Estimate, f: FloatArray, quantity: Quantity) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Changes with the parameters, in steps of one standard deviation each.

    They are those of the responses at frequencies f, Hz, from the input (p, nf, ny, 1) and from the innovations
    (p, nf, ny, ny), and of the quantity (p, q).
    """
    ny = pilot.model.ny
    shape, square = (len(f), ny, 1), (len(f), ny, ny)

    def flattened(theta: FloatArray) -> FloatArray:
        """Real and imaginary parts of the responses, then the quantity, as the delta method takes them."""
        model = pilot.realise(theta)
        value = np.atleast_1d(np.asarray(quantity(model), dtype=float))
        responses = (model.frequency_response(f), model.noise_response(f))
        return np.concatenate([*(response.ravel().view(np.float64) for response in responses), value])

    changes = spread(flattened, pilot.parameters, pilot.covariance)
    if not np.isfinite(changes).all():
        raise SysidError("the quantity is not a finite number for the model, or for models near it")
    ends = 2 * np.cumsum([np.prod(shape), np.prod(square)])
    by_input, by_noise, target = np.split(changes, ends, axis=1)
    p = len(changes)
    input_response = np.ascontiguousarray(by_input).view(np.complex128).reshape(p, *shape)
    noise_response = np.ascontiguousarray(by_noise).view(np.complex128).reshape(p, *square)
    return input_response, noise_response, target


def _nuisance(pilot: Estimate, root: FloatArray, samples: int, *, offset: bool) -> FloatArray:
    """Orthonormal effects of the initial state and the offset on the white prediction errors (ny n, m).

    `root` is the Cholesky factor of the variance of the innovations.
    """
    m = pilot.model
    # the predictor of the initial state, and offsets behind the whitening filter, which is constant at 0 Hz
    free = StateSpace(m.A - m.gain @ m.C, np.eye(m.order), m.C, np.zeros((m.ny, m.order)), None, m.dt)
    by_state = np.linalg.solve(root, free.markov(samples + 1)[1:]) if m.order else np.zeros((samples, m.ny, 0))
    columns = [by_state]
    if offset:
        columns.append(np.broadcast_to(np.eye(m.ny), (samples, m.ny, m.ny)))
    table = np.concatenate(columns, axis=2).transpose(1, 0, 2).reshape(samples * m.ny, -1)
    basis, values, _ = svd(table, full_matrices=False)
    return np.asarray(basis[:, values > SAME * values.max(initial=0.0)])


@dataclass(frozen=True, eq=False)
class Information:
    """Information of an input about one model, its parameters in steps of one standard deviation of the pilot.

    The prediction errors, made white, change with parameter k by S_k u + noise. What the noise tells does not depend on
    the input: in open loop it adds a constant [Ljung1999, sec. 9.4 and 13.3].

    Attributes:
        filters: S at the frequencies of the transform (p, ny, nf).
        noise: Information of the noise itself in a record (p, p).
        nuisance: Effects of offset and initial state, which are estimated too, orthonormal (ny n, m).
        target: Derivatives of the quantity (p, q).
        samples: Length n of a record.
        size: Length of the transform.
    """

    filters: ComplexArray
    noise: FloatArray
    nuisance: FloatArray
    target: FloatArray
    samples: int
    size: int

    @staticmethod
    def of(pilot: Estimate, samples: int, size: int, quantity: Quantity, *, offset: bool) -> "Information":
        """Differentiate a model by its parameters."""
        m = pilot.model
        f = np.asarray(np.fft.rfftfreq(size, m.dt), dtype=np.float64)
        by_input, by_noise, target = _derivatives(pilot, f, quantity)
        root = np.asarray(np.linalg.cholesky(pilot.noise_variance), dtype=np.float64)
        whiten = np.linalg.inv(m.noise_response(f) @ root)
        filters = (whiten @ by_input)[..., 0]
        random = (whiten @ by_noise @ root).reshape(len(target), len(f), -1)
        # lines between 0 Hz and the Nyquist frequency stand for their conjugates too
        unpaired = (np.arange(len(f)) == 0) | (2 * np.arange(len(f)) == size)
        weights = np.where(unpaired, 1.0, 2.0) * samples / size
        return Information(
            np.ascontiguousarray(filters.transpose(0, 2, 1)),
            np.einsum("kfi,lfi,f->kl", random.conj(), random, weights).real,
            _nuisance(pilot, root, samples, offset=offset),
            target,
            samples,
            size,
        )

    def effects(self, u: FloatArray) -> FloatArray:
        """Changes of the white prediction errors with the parameters, less what nuisances explain (p, ny n)."""
        responses = np.fft.irfft(self.filters * np.fft.rfft(u, self.size), self.size)[..., : self.samples]
        flat = responses.reshape(len(responses), -1)
        return flat - (flat @ self.nuisance) @ self.nuisance.T

    def of_signal(self, u: FloatArray) -> tuple[float, FloatArray]:
        """Criterion of a record (n,) from rest, and its derivatives by the samples (n,)."""
        effects = self.effects(u)
        value, roots = self.criterion(effects @ effects.T + self.noise)
        # -tr(R' dM R) with dM = dE E' + E dE', E the effects: -2 times the correlation of the filters with R' E
        signals = np.fft.rfft((roots.T @ effects).reshape(roots.shape[1], -1, self.samples), self.size)
        combined = np.tensordot(roots.T, self.filters, 1)
        slope = np.fft.irfft(np.sum(combined.conj() * signals, axis=(0, 1)), self.size)[: self.samples]
        return value, -2.0 * slope

    def of_shares(self, shares: FloatArray, energy: float) -> tuple[float, FloatArray]:
        """Criterion of an input that divides its energy over the lines by shares (nf,), and its slopes, negated."""
        flat = self.filters.reshape(len(self.filters), -1)
        weighted = (self.filters * (shares * energy)).reshape(flat.shape)
        value, roots = self.criterion((weighted @ flat.conj().T).real + self.noise)
        gains = np.abs(np.tensordot(roots.T, self.filters, 1)) ** 2
        # the noise tells as much whatever the shares are, and their sum is 1: it belongs to each
        return value, energy * gains.sum(axis=(0, 1)) + float(np.sum(roots * (self.noise @ roots)))

    def criterion(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Variance of the quantity for an information matrix M, and R of its differential -tr(R' dM R) (p, q).

        Raises:
            SysidError: The information does not determine the parameters.
        """
        values, vectors = np.linalg.eigh(information)
        if not values[0] > SINGULAR * values[-1]:
            raise SysidError(f"the input does not determine the {len(values)} parameters: eigenvalues {values}")
        roots = (vectors / values) @ (vectors.T @ self.target)
        return float(np.sum(roots * self.target)), roots

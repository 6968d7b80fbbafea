"""Fits to frequency responses: efficiency, coverage, false alarms, and time beside vector fitting.

Columns: the mean of |W (Ghat - G)|^2 / p, W the inverse root of the errors' covariance, with its standard error (1 is
the Cramer-Rao bound); coverage of 95 % intervals of |G| at five frequencies, of natural frequencies and of dampings;
rejections at 5 % by the test on the sum of squares; fits with a larger sum than the truth, where a search has failed;
processor time per fit. scikit-rf, if installed, fits the same data; it takes no variances.
"""

import warnings
from dataclasses import dataclass

import numpy as np

import sysid
from sysid import FrequencyResponse
from sysid.continuous.response_likelihood import Likelihood
from tests.benchmarks.tables import heading, options, row, timed
from tests.sysid.systems import covered, multivariable

WIDE, NARROW = np.geomspace(0.01, 1000.0, 60), np.linspace(0.2, 24.0, 80)
AVERAGES = 10
S, Z = 2j * np.pi * WIDE, np.exp(2j * np.pi * NARROW * 0.02)
STIFF = (np.polyval([3.0, 50.0], S) / np.polyval([1.0, 2.0, 40.0, 60.0], S))[:, None, None]
TWO_INPUTS = np.stack([(0.4 * Z + 0.2) / (Z**2 - 1.5 * Z + 0.7), (0.3 / Z + 0.1 / Z**2) / (Z**2 - 0.8 * Z + 0.5)], -1)


@dataclass(frozen=True)
class Case:
    """True response, and an estimator with the number of its parameters."""

    hz: np.ndarray
    g: np.ndarray
    estimator: object
    count: int
    dt: float = 0.0
    averaged: bool = False
    equal: bool = False

    def known(self, g):
        """A response with the true covariance: 5 % of each entry or of the largest, correlation 0.6 between entries."""
        if self.averaged:
            return FrequencyResponse.from_data(self.hz, g, variance=0.04 / (AVERAGES - 1) * np.abs(self.g) ** 2)
        size = 0.05 * np.abs(self.g).reshape(len(g), -1)
        size = np.full(size.shape, size.max()) if self.equal else size
        covariance = size[:, :, None] * size[:, None, :] * (0.4 * np.eye(size.shape[1]) + 0.6)
        return FrequencyResponse.from_data(self.hz, g, dt=self.dt, covariance=covariance)

    def drawn(self, rng):
        """A measured response; `averaged` as an analyser does, from spectra with noise of 20 % and their coherence."""
        if self.averaged:
            u, v = rng.standard_normal((2, AVERAGES, len(self.g), 2)) @ [1.0, 1j]
            y = self.g[:, 0, 0] * (u + 0.2 * v)
            uu, yy, yu = np.mean(np.abs(u) ** 2, 0), np.mean(np.abs(y) ** 2, 0), np.mean(y * u.conj(), 0)
            coherence = np.abs(yu) ** 2 / (uu * yy)
            return FrequencyResponse.from_data(self.hz, yu / uu, coherence=coherence, averages=AVERAGES)
        unit = rng.standard_normal((len(self.g), self.g[0].size, 2)) @ [np.sqrt(0.5), 1j * np.sqrt(0.5)]
        root = np.linalg.cholesky(self.known(self.g).joint_covariance)
        return self.known(self.g + (root @ unit[..., None]).reshape(self.g.shape))


def scikit_rf(response):
    """Vector fitting by scikit-rf, as a function of frequencies."""
    from skrf import Frequency, Network
    from skrf.vectorFitting import VectorFitting

    frequency = Frequency.from_f(response.frequencies, unit="hz")
    fit = VectorFitting(Network(frequency=frequency, s=response.response))
    fit.vector_fit(n_poles_real=1, n_poles_cmplx=1, init_pole_spacing="log", fit_constant=False)
    return lambda hz: fit.get_model_response(0, 0, hz)[:, None, None]


SQUARE = multivariable()
CASES = {
    "transfer function over five decades": Case(WIDE, STIFF, lambda r: sysid.fit_response(r, 2, 3), 5),
    "variance known up to a factor": Case(WIDE, STIFF, lambda r: sysid.fit_response(r, 2, 3, known_variance=False), 5),
    "variances from 10 averages": Case(WIDE, STIFF, lambda r: sysid.fit_response(r, 2, 3), 5, averaged=True),
    "unknown delay": Case(
        WIDE[:35], (STIFF * np.exp(-0.02 * S)[:, None, None])[:35], lambda r: sysid.fit_response(r, 2, 3, delay=None), 6
    ),
    "two inputs, discrete time": Case(
        NARROW, TWO_INPUTS[:, None], lambda r: sysid.fit_response(r, 2, 2, (1, 3)), 8, 0.02
    ),
    "state space, 2 inputs, 2 outputs, order 4": Case(
        NARROW, SQUARE.frequency_response(NARROW), lambda r: sysid.fit_response_ss(r, 4), 20, 0.02
    ),
}
PEERS = {
    f"equal errors: {name}": Case(WIDE[20:50], STIFF[20:50], fit, 5, equal=True)
    for name, fit in {
        "fit_response": lambda r: sysid.fit_response(r, 2, 3),
        "vector_fit": lambda r: sysid.vector_fit(r, 3, direct=False).frequency_response,
        "scikit-rf": scikit_rf,
    }.items()
}


def efficiency(name, case, draws):
    """One row of the first table."""
    figures, times = [], []
    ends = np.linspace(0, len(case.g) - 1, 7).astype(int)[1:-1]
    truth = case.estimator(case.known(case.g))
    truth = sysid.damp(truth) if isinstance(truth, sysid.Estimate) else None
    for seed in range(draws):
        response = case.drawn(np.random.default_rng(seed))
        estimate, time = timed(case.estimator, response)
        times.append(time)
        values = estimate.frequency_response(case.hz).response if truth else estimate(case.hz)
        bound = Likelihood.of(case.known(values), True)
        figures.append([np.sum(bound.errors(case.g) ** 2) / case.count])
        if truth:
            intervals = [end[ends] for end in estimate.frequency_response(case.hz).magnitude_ci95()]
            figures[-1].append(np.mean(covered(intervals, np.abs(case.g[ends]))))
            for quantity in ("natural_frequency", "damping"):
                true = getattr(truth, quantity).value
                inside = covered(getattr(sysid.damp(estimate), quantity).ci95, true)
                # the damping of a real pole is 1
                figures[-1].append(np.mean(inside[np.abs(true) < 1.0] if quantity == "damping" else inside))
            squares = np.sum(Likelihood.of(response, True).errors(case.g) ** 2)
            p_value = estimate.diagnostics["p_value"]
            rejected = p_value < 0.05 if np.isfinite(p_value) else np.nan
            figures[-1] += [rejected, estimate.diagnostics["sum_of_squares"] > squares]
    mean, error = np.mean(figures, axis=0), np.std(figures, axis=0)[0] / np.sqrt(draws)
    cells = [mean[0], error, *mean[1:]]
    row(
        name,
        *("" if np.isnan(cell) else f"{cell:.3f}" for cell in cells),
        *[""] * (7 - len(cells)),
        f"{1e3 * np.median(times):.1f}",
    )


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--draws", type=int, default=500, help="responses per case")
    chosen = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        heading("fit", "efficiency", "s.e.", "abs G", "natural frequency", "damping", "rejected", "worse", "time / ms")
        for name, case in {**CASES, **PEERS}.items():
            try:
                efficiency(name, case, chosen.draws)
            except ImportError:
                row(name, "not installed")

"""Time series and regularised impulse responses: efficiency, coverage, and fits on random systems.

The first table has, per estimator of y = C/A e, the mean of error' J error / p (1 is the Cramer-Rao bound), and the
coverage of nominal 95 % intervals of the parameters, of the disturbance's spectrum and of the forecast. The second has
the mean fit 100 (1 - |g - ghat| / |g - mean(g)|) of the first 100 values of impulse responses of random systems of
order 10 with white inputs, and the coverage of the 95 % intervals of `impulseest`.
"""

import warnings

import numpy as np
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials
from sysid.models import innovations_form
from tests.benchmarks.tables import heading, options, row
from tests.sysid.systems import covered, parameters_covered, random_polynomial

A, C, SAMPLES, STEPS, LAGS = [1.0, -1.5, 0.7], [1.0, 0.5], 500, 10, 100
HZ = np.array([0.02, 0.06, 0.12, 0.2, 0.35])
CASES = {
    "arma": (C, lambda data: sysid.arma(data, 2, 1)),
    **{
        f'ar, "{name}"': ([1.0], lambda data, name=name: sysid.ar(data, 2, approach=name))
        for name in ("fb", "ls", "burg", "yw")
    },
}
RESPONSES = {
    **{
        f"impulseest, {kernel or 'no prior'}": lambda data, kernel=kernel: sysid.impulseest(data, LAGS, kernel=kernel)
        for kernel in ("tc", "dc", "ss", None)
    },
    "arx of order 20": lambda data: sysid.arx(data, 20, 20, 0),
    "arx of order 20, tc": lambda data: sysid.arx(data, 20, 20, 0, regularisation="tc"),
}


def information(c):
    """Information of one sample about a1, a2 (and c1): the covariance of the gradient, by long filters."""
    pulse = np.eye(1, 2000)[0]
    by_a, by_c = lfilter([1.0], A, pulse), -lfilter([1.0], c, pulse)
    columns = [np.roll(by_a, 1), np.roll(by_a, 2), *([np.roll(by_c, 1)] if len(c) > 1 else [])]
    return np.array(columns) @ np.array(columns).T


def series(draws):
    """Efficiency and coverage of the estimators of time series."""
    heading("estimator", "error' J error / p", "its standard error", "parameters", "spectrum", "forecast")
    for name, (c, estimator) in CASES.items():
        truth = innovations_form(Polynomials(A=A, B=[], C=c), 1.0, 1.0)
        true, J = np.array([*A[1:], *c[1:]]), SAMPLES * information(c)
        power = np.abs(truth.noise_response(HZ)[:, 0, 0]) ** 2
        errors, coverage = [], []
        for seed in range(draws):
            rng = np.random.default_rng(seed)
            y = lfilter(c, A, rng.standard_normal(300 + SAMPLES + STEPS))[300:, None]
            data = IOData(None, y[:SAMPLES], 1.0)
            estimate = estimator(data)
            error = estimate.parameters - true
            errors.append(error @ J @ error / len(true))
            coverage.append(
                [
                    np.mean(parameters_covered(estimate, true)),
                    np.mean(covered(estimate.spectrum(HZ).noise_ci95(), power[:, None])),
                    np.mean(covered(sysid.forecast(estimate, data, STEPS).interval(), y[SAMPLES:])),
                ]
            )
        figures = (np.mean(errors), np.std(errors) / np.sqrt(draws), *np.mean(coverage, axis=0))
        row(name, *(f"{figure:.3f}" for figure in figures))


def responses(systems):
    """Fits of impulse responses of random systems, and the coverage of their intervals."""
    heading("estimator", *(f"{n} samples, {snr} dB" for n, snr in ((500, 10), (250, 0))), "coverage")
    figures = {name: [[], [], []] for name in [*RESPONSES, "cra"]}
    for seed in range(systems):
        rng = np.random.default_rng(seed)
        a = random_polynomial(rng, 10, 0.95)
        b = np.concatenate(([0.0], rng.standard_normal(len(a) - 1)))
        g = lfilter(b, a, np.eye(1, LAGS)[0])
        for case, (n, snr) in enumerate(((500, 10), (250, 0))):
            u = rng.standard_normal(n + LAGS)
            clean = lfilter(b, a, u)
            y = clean + clean.std() * 10 ** (-snr / 20) * rng.standard_normal(n + LAGS)
            data = IOData(u[LAGS:], y[LAGS:], 1.0)
            for name, estimator in RESPONSES.items():
                estimate = estimator(data)
                figures[name][case].append(fit(estimate.model.impulse_response(LAGS)[:, 0, 0], g))
                if estimate.method == "impulseest":
                    figures[name][2].append(np.mean(parameters_covered(estimate, g)))
            if n > 2 * LAGS + 100:
                figures["cra"][case].append(fit(sysid.cra(data, lags=LAGS - 1).response[:, 0, 0], g))
    for name, (first, second, coverage) in figures.items():
        means = (f"{np.mean(fits):.1f}" if fits else "" for fits in (first, second))
        row(name, *means, f"{np.mean(coverage):.3f}" if coverage else "")


def fit(estimated, g):
    """Percentage of a response that an estimate explains."""
    return 100.0 * (1.0 - np.linalg.norm(estimated - g) / np.linalg.norm(g - g.mean()))


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--draws", type=int, default=500, help="records per estimator of time series")
    parser.add_argument("--systems", type=int, default=100, help="random systems")
    arguments = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        series(arguments.draws)
        print()
        responses(arguments.systems)

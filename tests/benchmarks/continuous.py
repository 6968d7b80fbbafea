"""Models in continuous time beside the Cramér-Rao bound, `oe` with `d2c`, and SciPy.

Records are 400 samples every 0.1 s in mid-motion, the input held 4 samples, the output disturbed by 10 % of white or
autoregressive noise (one pole at 0.9), in the last row by 100 %. The third column is the mean of error' J error / p,
where J is the information at the truth for white noise and free initial states: 1 for an estimator that reaches the
bound. Then come shares of 95 % intervals that contain the truth, natural frequency and damping those of the slowest
pole. Neither SciPy nor a package of the Python index that we know of fits such models to records; SciPy's
`least_squares` begins at the truth.
"""

import warnings

import numpy as np
import scipy

import sysid
from sysid.continuous.output_error_criterion import OutputError
from sysid.continuous.structures import ProcessPath, RationalPath
from tests.benchmarks.tables import heading, options, row, timed
from tests.sysid.continuous.record import record
from tests.sysid.systems import covered, parameters_covered

DT, SAMPLES, HOLD, SETTLING = 0.1, 400, 4, 200


def scipy_fit(data):
    """Parameters of the oscillator and two initial states by numerical derivatives, from the truth."""

    def errors(theta):
        b, a, _ = scipy.signal.cont2discrete((theta[:2], [1.0, *theta[2:4]]), DT)
        return data.y[:, 0] - scipy.signal.lfilter(b[0], a, data.u[:, 0], zi=theta[4:])[0]

    return scipy.optimize.least_squares(errors, [*OSCILLATOR[1], 0.0, 0.0], x_scale="jac").x[:4]


OSCILLATOR = RationalPath(2, 1), [1.0, 4.0, 1.0, 4.0]
LAGS = ProcessPath("P2"), [2.0, 1.5, 0.4]
LATE = RationalPath(2, 0, None), [4.0, 1.0, 4.0, 0.05]
CASES = (
    ("oscillator with a zero", *OSCILLATOR, 0.0, 0.1, "tfest", lambda data: sysid.tfest(data, 2, 1)),
    ("", *OSCILLATOR, 0.0, 0.1, "oe, d2c", lambda data: sysid.d2c(sysid.oe(data, 2, 2, 1))),
    ("", *OSCILLATOR, 0.0, 0.1, "SciPy", scipy_fit),
    ("the same, coloured noise", *OSCILLATOR, 0.9, 0.1, "tfest", lambda data: sysid.tfest(data, 2, 1)),
    ("two time constants", *LAGS, 0.0, 0.1, "procest", lambda data: sysid.procest(data, "P2")),
    (
        *("oscillator with a zero and a delay of 0.234 s", RationalPath(2, 1, None), [*OSCILLATOR[1], 0.234], 0.0, 0.1),
        *("tfest", lambda data: sysid.tfest(data, 2, 1, delay=None)),
    ),
    (
        *("without a zero, delay of 0.05 s, 100 % noise", *LATE, 0.0, 1.0),
        *("tfest", lambda data: sysid.tfest(data, 2, 0, delay=None)),
    ),
)


def measure(structure, truth, colour, level, method, draws):
    """Loss of efficiency, coverages and median time, ms, of one method."""
    path, delayed = structure.transfer(truth), structure.delay is None
    poles = np.roots(path.a[::-1])
    slowest = poles[np.argmin(np.abs(poles))]
    size, damping = abs(slowest) / (2.0 * np.pi), -slowest.real / abs(slowest)
    figures = []
    for seed in range(draws):
        b, a = path.b[::-1] / path.a[-1], path.a[::-1] / path.a[-1]
        quiet = record(b, a, path.delay, DT, HOLD, samples=SAMPLES, seed=seed)
        e = np.random.default_rng(draws + seed).standard_normal(SAMPLES + SETTLING)
        size_of_noise = level * np.std(quiet.y)
        noise = size_of_noise * np.sqrt(1.0 - colour**2) * scipy.signal.lfilter([1.0], [1.0, -colour], e)
        data = sysid.IOData(quiet.u, quiet.y + noise[SETTLING:, None], DT)
        at = OutputError([data], [structure], 0.5, True)(truth)
        estimate, seconds = timed(method, data)
        theta, coverage = estimate, [np.nan] * 4
        if isinstance(estimate, sysid.ContinuousEstimate):
            modes, theta, hits = sysid.damp(estimate), estimate.parameters, parameters_covered(estimate, truth)
            coverage = [np.mean(hits), covered(modes.natural_frequency.ci95, size)[0]]
            coverage.append(covered(modes.damping.ci95, damping)[0] if slowest.imag else np.nan)
            coverage.append(hits[-1] if delayed else np.nan)
            if estimate.method == "oe":
                theta = np.concatenate([estimate.continuous.path()[0], estimate.continuous.path()[1][1:]])
                coverage[0] = np.nan
        scaled = at.triangle @ (at.scale * (theta - truth)) / size_of_noise
        figures.append([scaled @ scaled / len(truth), *coverage, 1e3 * seconds])
    columns = np.array(figures, dtype=float)
    return [*np.mean(columns[:, :-1], axis=0), np.median(columns[:, -1])]


def main():
    parser = options(__doc__)
    parser.add_argument("--draws", type=int, default=500)
    asked = parser.parse_args()
    warnings.simplefilter("ignore", sysid.SysidWarning)
    heading("system", "method", "error' J error / p", "parameters", "natural frequency", "damping", "delay", "ms")
    for name, structure, truth, colour, level, label, method in CASES:
        loss, *coverage, milliseconds = measure(structure, np.array(truth), colour, level, method, asked.draws)
        shown = ("–" if np.isnan(share) else f"{share:.3f}" for share in coverage)
        row(name, label, f"{loss:.2f}", *shown, f"{milliseconds:.0f}")


if __name__ == "__main__":
    main()

"""Records with known truth for `calibration.py`, the estimators that are asked, and what they claim of their errors.

All systems have a sampling interval of 1 s and the path B/F = (q^-1 + 0.5 q^-2) / (1 - 1.2 q^-1 + 0.5 q^-2) unless the
estimator needs another one; the disturbance has 0.3 of the standard deviation of the output without it. Searches that
take a start begin at the truth: what is measured is the claim about the minimum; how often it is found is measured by
`stress.py`.
"""

import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import scipy
from scipy.signal import cont2discrete, lfilter

import sysid
from sysid import IOData, Polynomials, SysidError, SysidWarning
from sysid.models.delta_method import standard_directions
from sysid.models.frequency_response import NORMAL_95
from sysid.models.repeated_errors import AnyEstimate

RATIO = 0.3  # standard deviation of the disturbance over that of the output without it
LEAD = 300  # samples before the record
PERIOD = 100
LINES = np.arange(1, PERIOD // 2)  # of the repeating input, all of equal amplitude
SEQUENCES = 20_000  # from which the linear part of the distortion is known
HZ = 0.1  # at which gains are judged
GAINS = np.array([0.02, 0.1, 0.2])  # Hz, likewise of `model_error`


@dataclass(frozen=True)
class System:
    """Path and disturbance of records with one output: y = B/F u + C/D e, dt = 1 s.

    Attributes:
        b: Numerator from lag 0 on.
        f: Denominator.
        c: Numerator of the disturbance.
        d: Its denominator.
        feedback: Factor k of u = r - k y.
    """

    b: tuple[float, ...]
    f: tuple[float, ...]
    c: tuple[float, ...] = (1.0,)
    d: tuple[float, ...] = (1.0,)
    feedback: float = 0.0

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of e."""
        pulse = np.eye(1, LEAD)[0]
        output = np.linalg.norm(lfilter(self.b, self.f, pulse)) or 1.0
        return RATIO * float(output / np.linalg.norm(lfilter(self.c, self.d, pulse)))

    def response(self, hz):
        """Complex response of the path at frequencies in Hz."""
        return scipy.signal.freqz(self.b, self.f, hz, fs=1.0)[1]

    def spectrum(self, hz):
        """Spectrum of the disturbance (two-sided, unit^2/Hz)."""
        return self.deviation**2 * np.abs(scipy.signal.freqz(self.c, self.d, hz, fs=1.0)[1]) ** 2

    @cached_property
    def bandwidth(self) -> float:
        """First frequency of half the power at 0 Hz."""
        hz = np.linspace(0.0, 0.5, 2001)
        ratio = np.abs(self.response(hz) / self.response([0.0])) ** 2 - 0.5
        k = int(np.argmax(ratio < 0.0))
        return float(
            scipy.optimize.brentq(
                lambda x: float(np.abs(self.response([x]) / self.response([0.0]))[0] ** 2 - 0.5), hz[k - 1], hz[k]
            )
        )


@dataclass(frozen=True)
class Problem:
    """What records of a problem have beside a system.

    Attributes:
        samples: Length.
        repeats: Whether the input is a random-phase multisine that repeats, instead of white noise.
        distorted: Whether half of the innovations' power is a static nonlinearity of the last input.
        quantised: Whether the output is rounded to steps of one standard deviation of the innovations e.
    """

    samples: int = 400
    repeats: bool = False
    distorted: bool = False
    quantised: bool = False


PROBLEMS = {
    "own errors": Problem(),
    "coloured errors": Problem(),
    "repeating input": Problem(500, repeats=True),
    "repeating errors": Problem(500, repeats=True, distorted=True),
    "quantised output": Problem(quantised=True),
    "short record": Problem(120),
}


def sequences(rng, count):
    """Periods of random-phase multisines of unit power (count, PERIOD)."""
    lines = np.zeros((count, PERIOD // 2 + 1), dtype=complex)
    lines[:, LINES] = np.exp(2j * np.pi * rng.random((count, len(LINES))))
    return np.fft.irfft(lines, PERIOD, axis=1) * PERIOD / np.sqrt(2.0 * len(LINES))


def bent(u):
    """A static nonlinearity, bounded, so that its errors are no outliers."""
    return np.sin(2.0 * u)


@cache
def distortion_moments():
    """Linear part of the bent input over many sequences, and the deviation of the remainder, which has no linear part.

    The lines have equal power, so that the remainder is uncorrelated with the input at every line.
    """
    u = sequences(np.random.default_rng(1), SEQUENCES)
    slope = float(np.mean(bent(u) * u) / np.mean(u**2))
    return slope, float(np.std(bent(u) - slope * u))


def record(system, problem, rng):
    """One record of a system: data, input before feedback, and the output without disturbance."""
    total = LEAD + problem.samples
    r = np.resize(sequences(rng, 1)[0], total) if problem.repeats else rng.standard_normal(total)
    e = rng.standard_normal(total)
    if problem.distorted:
        slope, deviation = distortion_moments()
        before = np.roll(r, 1)
        e = np.sqrt(0.5) * (e + (bent(before) - slope * before) / deviation)
    v = system.deviation * lfilter(system.c, system.d, e)
    # u = r - k y, y = B/F u + v
    loop = np.polynomial.polynomial.polyadd(system.f, system.feedback * np.array(system.b))
    y = lfilter(system.b, loop, r) + lfilter(system.f, loop, v)
    u = r - system.feedback * y
    if problem.quantised:
        y = system.deviation * np.round(y / system.deviation)
    u, y, r = u[LEAD:], y[LEAD:], r[LEAD:]
    return IOData(u if any(system.b) else None, y, 1.0), r


B, F = (0.0, 1.0, 0.5), (1.0, -1.2, 0.5)
ARX = System(B, F, d=F)
OE = System(B, F)
ARMAX = System(B, F, (1.0, 0.5), F)
BJ = System(B, F, (1.0, 0.5), (1.0, -0.7))
GENERAL = System((0.0, 1.0), (1.0, -1.3, 0.4), (1.0, 0.4), (1.0, -0.5))
INNOVATIONS = System(B, F, (1.0, -0.3, 0.02), F)
SMOOTH = System((1.0, 0.3), (1.0,))  # hardly any bias by smoothing over frequency
COLOURED_SMOOTH = replace(SMOOTH, d=(1.0, -0.5))
COLOURED = System(B, F, d=(1.0, -0.8))
LOOP, COLOURED_LOOP = replace(OE, feedback=0.1), replace(COLOURED, feedback=0.1)
SERIES = {"ar": System((0.0,), (1.0,), d=F), "arma": System((0.0,), (1.0,), (1.0, 0.5), F)}

CONTINUOUS = (0.25, 0.6, 0.25)
"""b0, a1 and a0 of b0 / (s^2 + a1 s + a0)."""
PROCESS = (2.0, 4.0, 2.4)
"""Gain, time constant and delay of 2 exp(-2.4 s) / (1 + 4 s), in s."""


def sampled_continuous(d=(1.0,)):
    """The continuous system under a held input."""
    b0, a1, a0 = CONTINUOUS
    numerator, f, _ = cont2discrete(([b0], [1.0, a1, a0]), 1.0)
    return System(tuple(numerator[0]), tuple(f), d=d)


def sampled_process(d=(1.0,)):
    """The process with its delay of a fraction of the interval, under a held input."""
    gain, constant, delay = PROCESS
    whole, fraction = int(delay), delay - int(delay)
    early = gain * (1.0 - np.exp(-(1.0 - fraction) / constant))
    late = gain * (1.0 - np.exp(-1.0 / constant)) - early
    # the late part is that of the input before, decayed
    return System((0.0,) * (whole + 1) + (early, late), (1.0, -float(np.exp(-1.0 / constant))), d=d)


Claim = tuple[float, float, float, bool]
"""Error over claimed deviation, that deviation, the probability integral transform, and whether the 95 % interval
(region) holds the truth; NaN where the claim has no such figure."""

NONE = float("nan")


def normal_claim(error, deviation) -> Claim:
    """Claim of an error that has a normal distribution."""
    z = error / deviation
    return z, deviation, float(scipy.stats.norm.cdf(z)), abs(z) <= NORMAL_95


def vector_claim(error, covariance, freedom=None) -> Claim:
    """Claim of a vector: its Mahalanobis statistic is chi-square, or Fisher's of an estimated variance."""
    directions = standard_directions(covariance)
    steps = np.linalg.lstsq(directions, error, rcond=None)[0]
    square, p = float(steps @ steps), len(error)
    if freedom is None:
        probability = float(scipy.stats.chi2.cdf(square, p))
    else:
        probability = float(scipy.stats.f.cdf(square / p, p, freedom))
    return NONE, NONE, probability, probability <= 0.95


def response_claims(response, true_response, k=0) -> dict[str, Claim]:
    """Claims of gain and complex response at one frequency."""
    g, covariance = response.response[k, 0, 0], response.covariance[k, 0, 0]
    low, high = (float(end[k, 0, 0]) for end in response.magnitude_ci95())
    error, deviation = abs(g) - abs(true_response), float(response.magnitude_deviation()[k, 0, 0])
    freedom, z = response.degrees_of_freedom, error / deviation
    probability = float(scipy.stats.norm.cdf(z) if freedom is None else scipy.stats.t.cdf(z, freedom))
    departure = g - true_response
    return {
        "gain": (z, deviation, probability, low <= abs(true_response) <= high),
        "response": vector_claim(np.array([departure.real, departure.imag]), covariance, freedom),
    }


def bandwidth_claim(bandwidth, truth) -> Claim:
    """Claim of the logarithm of the bandwidth; where there is none, no interval holds the truth."""
    hz, (low, _) = bandwidth.hz[0, 0], (end[0, 0] for end in bandwidth.ci95)
    holds = bool(bandwidth.covers(truth)[0, 0])
    if not (np.isfinite(hz) and low > 0.0):
        return NONE, NONE, NONE, holds
    return *normal_claim(np.log(hz / truth), np.log(hz / low) / NORMAL_95)[:3], holds


def path_claims(estimate, system) -> dict[str, Claim]:
    """Claims of the path from input to output: gain, response and bandwidth."""
    response, bandwidth = estimate.response_and_bandwidth([HZ])
    claims = response_claims(response, system.response([HZ])[0])
    return claims | {"bandwidth": bandwidth_claim(bandwidth, system.bandwidth)}


def parameter_claims(estimate, truth, listed=None, judged=None) -> dict[str, Claim]:
    """Claims of the parameters, one by one (those `listed`) and together, all or those whose name is `judged`."""
    names = estimate.parameter_names
    kept = [k for k in range(len(names)) if judged is None or judged(names[k])]
    error = estimate.parameters - np.asarray(truth)
    deviations = np.sqrt(np.diag(estimate.covariance))
    claims = {names[k]: normal_claim(error[k], deviations[k]) for k in listed or kept}
    return claims | {"vector": vector_claim(error[kept], estimate.covariance[np.ix_(kept, kept)])}


def spectrum_claim(estimate, system) -> dict[str, Claim]:
    """Claim of the logarithm of the disturbance's spectrum."""
    response = estimate.spectrum([HZ])
    power = float(response.noise_spectrum[0, 0, 0].real)
    return {"spectrum": normal_claim(np.log(power / system.spectrum([HZ])[0]), float(response.noise_deviation[0, 0]))}


def noise_claim(response, system, k=0) -> dict[str, Claim]:
    """Check a nonparametric spectrum of the disturbance, which should scatter as chi-square over its freedom."""
    true = float(system.spectrum([response.frequencies[k]])[0])
    freedom = response.degrees_of_freedom
    low, high = (float(end[k, 0]) for end in response.noise_ci95())
    # the interval is total / quantile: the ratio to the truth has the distribution of chi-square over its freedom
    total = low * float(scipy.stats.chi2.ppf(0.975, freedom))
    probability = float(scipy.stats.chi2.cdf(total / true, freedom))
    return {"spectrum": (NONE, NONE, probability, low <= true <= high)}


@dataclass(frozen=True)
class Case:
    """An estimator on the records of a problem.

    Attributes:
        problem: Name of the problem.
        name: Of the estimator, with what differs from its defaults.
        outcome: From a generator to the claims on one record.
    """

    problem: str
    name: str
    outcome: Callable[[np.random.Generator], dict[str, Claim]] = field(compare=False)

    @property
    def key(self) -> str:
        """Name in the journal."""
        return f"{self.problem}/{self.name}"


NUMBERS = re.compile(r"(?<![a-z_])[-+]?\d[\d.e+-]*")


def asked(case, rng):
    """Claims on one record, the texts of the warnings without their numbers, and whether the estimator refused."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SysidWarning)
        try:
            claims = case.outcome(rng)
        except SysidError as error:
            return {}, [], str(error)
    texts = {NUMBERS.sub("#", str(message.message)) for message in caught if message.category is SysidWarning}
    return claims, sorted(texts), ""


Fit = Callable[[IOData, np.ndarray], Any]
"""From a record and the signal before the feedback to an estimate."""


def is_of_path(name):
    """Whether a parameter is one of the path: rounding joins the disturbance, whose model has no truth then."""
    return name[0] not in "cd"


def parametric(fit: Fit, system: System, truth, problem: Problem, has_spectrum=False, listed=None, judged=None):
    """Outcome of an estimator whose parameters have a truth, all of them or those `judged`; of many a few `listed`."""

    def outcome(rng):
        estimate = fit(*record(system, problem, rng))
        claims = parameter_claims(estimate, truth, listed, judged)
        return claims | spectrum_claim(estimate, system) if has_spectrum else claims

    return outcome


def responding(fit: Fit, system: System, problem: Problem):
    """Outcome of an estimator of state-space models, whose parameters have no truth."""

    def outcome(rng):
        return path_claims(fit(*record(system, problem, rng)), system)

    return outcome


def nonparametric(fit: Fit, system: System, problem: Problem, has_noise=True):
    """Outcome of an estimator of a response, and of the spectrum of the disturbance."""

    def outcome(rng):
        data, before = record(system, problem, rng)
        response = fit(data, before)
        k = int(np.argmin(np.abs(response.frequencies - HZ)))
        claims = response_claims(response, system.response([response.frequencies[k]])[0], k)
        # errors that repeat, or come of rounding, are no part of the spectrum that the system has
        if has_noise and not (problem.distorted or problem.quantised):
            claims |= noise_claim(response, system, k)
        return claims

    return outcome


def best_linear(system: System, problem: Problem, realisations=4, periods=4):
    """Outcome of `bla`: the response, and the p-value of "no distortion" where there is none."""
    problem = replace(problem, samples=periods * PERIOD, repeats=True)

    def outcome(rng):
        records = [record(system, problem, rng)[0] for _ in range(realisations)]
        found = sysid.bla(records, PERIOD)
        k = int(np.argmin(np.abs(found.response.frequencies - HZ)))
        claims = response_claims(found.response, system.response([found.response.frequencies[k]])[0], k)
        if not problem.distorted:
            p_value = float(found.distortion_p[k, 0, 0])
            claims["no distortion"] = (NONE, NONE, p_value, p_value >= 0.05)
        return claims

    return outcome


def drawn_response(kernel_length, decay=0.7):
    """Outcome of `impulseest` on responses that are drawn from its prior: simulation-based calibration."""
    lags = np.arange(kernel_length)
    root = np.linalg.cholesky(decay ** np.maximum(lags[:, None], lags))

    def outcome(rng):
        truth = root @ rng.standard_normal(kernel_length)
        u, e = rng.standard_normal((2, LEAD + 400))
        data = IOData(u[LEAD:], (lfilter(truth, [1.0], u) + 0.5 * e)[LEAD:], 1.0)
        return parameter_claims(sysid.impulseest(data, kernel_length), truth, (0, 2, 5, 10))

    return outcome


def gain_intervals(fit: Fit, system: System, problem: Problem):
    """Outcome of `model_error`: which intervals of the gain hold the truth."""

    def outcome(rng):
        data, before = record(system, problem, rng)
        error = sysid.model_error(fit(data, before), data, GAINS)
        low, high = (end[:, 0, 0] for end in error.interval)
        if np.isnan(low).any():
            # an interval of NaN claims nothing, as an error does
            raise SysidError("the interval is NaN: the record has too few lines to measure the order by")
        truth = np.abs(system.response(GAINS))
        claims = {}
        for k, hz in enumerate(GAINS):
            holds = bool(low[k] <= truth[k] <= high[k])
            claims[f"gain at {hz:g} Hz"] = (NONE, NONE, NONE, holds)
        return claims

    return outcome


def measured_response(fit: Callable[[Any], AnyEstimate], system: System, truth=None):
    """Outcome of a fit to a response with errors of known variance."""
    hz = np.arange(1, 41) / 100.0

    def outcome(rng):
        g = system.response(hz)
        deviation = 0.1 * np.abs(g) + 0.02
        errors = rng.standard_normal((2, len(hz))) * deviation / np.sqrt(2.0)
        response = sysid.FrequencyResponse.from_data(hz, g + errors[0] + 1j * errors[1], dt=1.0, variance=deviation**2)
        estimate = fit(response)
        claims = path_claims(estimate, system)
        return claims if truth is None else parameter_claims(estimate, truth) | claims

    return outcome


def least_squares_limit(system):
    """A and B that `arx` tends to where the errors are coloured, from exact covariances: white input of unit power."""
    pulse = np.eye(1, 2000)[0]
    g, h = lfilter(system.b, system.f, pulse), system.deviation * lfilter(system.c, system.d, pulse)

    def of_output(lag):
        return float(g[lag:] @ g[: len(g) - lag] + h[lag:] @ h[: len(h) - lag])

    outputs = scipy.linalg.toeplitz([of_output(0), of_output(1)])
    # E y(t - i) u(t - j) = g(j - i)
    cross = np.array([[g[0], g[1]], [0.0, g[0]]])
    normal = np.block([[outputs, -cross], [-cross.T, np.eye(2)]])
    return np.linalg.solve(normal, [-of_output(1), -of_output(2), g[1], g[2]])


def about_limit(problem):
    """Outcome of `arx(coloured=True)` beside errors that are not white, about the limit of its estimate."""
    system = ARMAX
    limit = least_squares_limit(system)

    def outcome(rng):
        data, _ = record(system, problem, rng)
        return parameter_claims(sysid.arx(data, 2, 2, coloured=True), limit)

    return outcome


def polynomials_of(a=(1.0,), b=B, c=(1.0,), d=(1.0,), f=(1.0,)):
    """True polynomials as a start."""
    return Polynomials(A=np.array(a), B=np.array([b]), C=np.array(c), D=np.array(d), F=np.array([f]))


def _warm_start(estimator, recursive, start, *orders):
    """Recursion from the batch estimate of the first third, as its page advises."""

    def fit(data, _):
        first = len(data) // 3
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            batch = estimator(data[:first], *orders, start=start)
        return recursive(data[first:], *orders, start=batch).final

    return fit


def _instruments(data):
    """Output of a rough model, that nothing disturbs."""
    return lfilter([0.0, 1.5], [1.0, -1.0, 0.4], data.u[:, 0])


def _periods(data):
    """The record cut into its periods, experiments with the same input."""
    return [data[k : k + PERIOD] for k in range(0, len(data) - PERIOD + 1, PERIOD)]


EVERYWHERE = tuple(name for name in PROBLEMS if name != "coloured errors")
WITHOUT_INPUT = ("own errors", "quantised output", "short record")
OF_ARMAX = polynomials_of(a=F, c=ARMAX.c)
OF_OE = polynomials_of(f=F)
OF_BJ = polynomials_of(c=BJ.c, d=BJ.d, f=F)
OF_GENERAL = polynomials_of(a=(1.0, -0.5), b=(0.0, 1.0), c=(1.0, 0.4), f=(1.0, -0.8))


def _polynomial_cases() -> list[Case]:
    """Estimators of discrete-time polynomials."""
    a, b = F[1:], B[1:]
    of_general = (-0.5, 1.0, 0.4, -0.8)
    fits: Mapping[str, tuple[Fit, System, tuple[float, ...]]] = {
        "arx": (lambda data, _: sysid.arx(data, 2, 2), ARX, a + b),
        "armax": (lambda data, _: sysid.armax(data, 2, 2, 1, start=OF_ARMAX), ARMAX, a + b + ARMAX.c[1:]),
        "oe": (lambda data, _: sysid.oe(data, 2, 2, start=OF_OE), OE, b + a),
        "bj": (lambda data, _: sysid.bj(data, 2, 1, 1, 2, start=OF_BJ), BJ, b + BJ.c[1:] + BJ.d[1:] + a),
        "polyest": (lambda data, _: sysid.polyest(data, 1, 1, 1, 0, 1, start=OF_GENERAL), GENERAL, of_general),
        "iv4": (lambda data, _: sysid.iv4(data, 2, 2), ARX, a + b),
        "ivx": (lambda data, _: sysid.ivx(data, 2, 2, 1, _instruments(data)), ARX, a + b),
        "two_stage": (lambda data, r: sysid.two_stage(data, 2, 2, 1, r, order=6), LOOP, b + a),
        "rarx": (lambda data, _: sysid.rarx(data, 2, 2).final, ARX, a + b),
        "rarmax": (_warm_start(sysid.armax, sysid.rarmax, OF_ARMAX, 2, 2, 1), ARMAX, a + b + ARMAX.c[1:]),
        "roe": (_warm_start(sysid.oe, sysid.roe, OF_OE, 2, 2), OE, b + a),
    }
    cases = []
    for name, (fit, system, truth) in fits.items():
        for problem in EVERYWHERE:
            judged = is_of_path if problem == "quantised output" else None
            cases.append(Case(problem, name, parametric(fit, system, truth, PROBLEMS[problem], judged=judged)))
    plain = PROBLEMS["coloured errors"]
    for name in ("oe", "iv4", "ivx", "two_stage"):
        fit, system, truth = fits[name]
        coloured = replace(COLOURED, feedback=system.feedback)
        cases.append(Case("coloured errors", name, parametric(fit, coloured, truth, plain)))
    cases.append(Case("coloured errors", "arx, coloured", about_limit(plain)))
    return cases


def _series_cases() -> list[Case]:
    """Time series."""
    cases = []
    start = Polynomials(A=np.array(F), B=np.zeros(0), C=np.array(SERIES["arma"].c))
    fits: Mapping[str, tuple[Fit, tuple[float, ...]]] = {
        "ar": (lambda data, _: sysid.ar(data, 2), F[1:]),
        "arma": (lambda data, _: sysid.arma(data, 2, 1, start=start), F[1:] + SERIES["arma"].c[1:]),
    }
    for problem in WITHOUT_INPUT:
        for name, (fit, truth) in fits.items():
            if problem == "quantised output" and name == "arma":
                continue
            outcome = parametric(
                fit, SERIES[name], truth, PROBLEMS[problem], has_spectrum=problem != "quantised output"
            )
            cases.append(Case(problem, name, outcome))
    return cases


def _impulse_cases() -> list[Case]:
    """Impulse responses."""
    cases = []
    fits: Mapping[str, tuple[Fit, int]] = {
        "impulseest, no prior": (lambda data, _: sysid.impulseest(data, 25, kernel=None), 25),
        "impulseest": (lambda data, _: sysid.impulseest(data, 25), 25),
    }
    for problem in EVERYWHERE:
        for name, (fit, length) in fits.items():
            # the response beyond the last coefficient is below 1e-3 of its peak
            truth = lfilter(B, F, np.eye(1, length)[0])
            outcome = parametric(fit, OE, truth, PROBLEMS[problem], listed=(1, 2, 5, 10))
            cases.append(Case(problem, name, outcome))
    cases.append(Case("own errors", "impulseest, truth from prior", drawn_response(25)))
    return cases


def _continuous_cases() -> list[Case]:
    """Continuous time."""
    cases = []
    fits: Mapping[str, tuple[Fit, Callable[..., System], tuple[float, ...]]] = {
        "tfest": (lambda data, _: sysid.tfest(data, 2, 0, start=CONTINUOUS), sampled_continuous, CONTINUOUS),
        "procest": (lambda data, _: sysid.procest(data, "P1D", max_delay=8.0, start=PROCESS), sampled_process, PROCESS),
    }
    for name, (fit, system, truth) in fits.items():
        for problem, setting in PROBLEMS.items():
            d = COLOURED.d if problem == "coloured errors" else (1.0,)
            cases.append(Case(problem, name, parametric(fit, system(d), truth, setting)))
    return cases


def _state_space_cases() -> list[Case]:
    """State-space models, from records and from responses."""
    cases = []
    start = state_space_start()
    fits: Mapping[str, tuple[Fit, System]] = {
        "okid": (lambda data, _: sysid.okid(data, 2, p=4), INNOVATIONS),
        "pem_ss": (lambda data, _: sysid.pem_ss(data, start, search=False), INNOVATIONS),
        "pem_ss, no gain": (lambda data, _: sysid.pem_ss(data, start, gain=False, search=False), OE),
    }
    for problem in EVERYWHERE:
        for name, (fit, system) in fits.items():
            cases.append(Case(problem, name, responding(fit, system, PROBLEMS[problem])))

    def coloured(data, _):
        return sysid.pem_ss(data, start, gain=False, coloured=True, search=False)

    outcome = responding(coloured, COLOURED, PROBLEMS["coloured errors"])
    cases.append(Case("coloured errors", "pem_ss, no gain, coloured", outcome))
    of_response = measured_response(lambda response: sysid.fit_response(response, 2, 2), OE, B[1:] + F[1:])
    of_states = measured_response(lambda response: sysid.fit_response_ss(response, 2, direct=False), OE)
    return [*cases, Case("own errors", "fit_response", of_response), Case("own errors", "fit_response_ss", of_states)]


def state_space_start():
    """True state-space model as a start, its innovation gain that of `INNOVATIONS`."""
    f1, f2 = F[1:]
    c1, c2 = INNOVATIONS.c[1:]
    a = np.array([[-f1, 1.0], [-f2, 0.0]])
    gain = np.array([[c1 - f1], [c2 - f2]])
    return sysid.StateSpace(a, np.array([[B[1]], [B[2]]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)), gain, 1.0)


def _nonparametric_cases() -> list[Case]:
    """Responses without a model structure."""
    cases = []
    fits: Mapping[str, Fit] = {
        "lpm": lambda data, _: sysid.lpm(data, [HZ]),
        "spa": lambda data, _: sysid.spa(data, frequencies=[HZ]),
        "spafdr": lambda data, _: sysid.spafdr(data, frequencies=[HZ]),
        "etfe, smoothed": lambda data, _: sysid.etfe(data, smoothing=5),
        "welch": lambda data, _: sysid.welch(data),
    }
    repeating: Mapping[str, Fit] = {
        "lpm, mean period": lambda data, _: sysid.lpm(data, [HZ], period=PERIOD),
        "etfe of the periods": lambda data, _: sysid.etfe(_periods(data)),
    }
    for problem, setting in PROBLEMS.items():
        system = COLOURED_SMOOTH if problem == "coloured errors" else SMOOTH
        for name, fit in (repeating if setting.repeats else fits).items():
            has_noise = name != "etfe of the periods"
            cases.append(Case(problem, name, nonparametric(fit, system, setting, has_noise)))
        if problem != "short record":
            cases.append(Case(problem, "bla", best_linear(system, setting)))
    resonant = nonparametric(fits["spa"], OE, PROBLEMS["own errors"])
    return [*cases, Case("own errors", "spa, beside a resonance", resonant)]


def _interval_cases() -> list[Case]:
    """Intervals of `model_error`, of a model with the orders of the truth and of one that is too simple."""
    cases = []
    for problem, setting in PROBLEMS.items():
        system = COLOURED if problem == "coloured errors" else OE
        outcome = gain_intervals(lambda data, _: sysid.oe(data, 2, 2, start=OF_OE), system, setting)
        cases.append(Case(problem, "model_error", outcome))
        if problem in ("own errors", "repeating input", "repeating errors"):
            outcome = gain_intervals(lambda data, _: sysid.oe(data, 1, 1), system, setting)
            cases.append(Case(problem, "model_error, order too low", outcome))
    return cases


@cache
def all_cases() -> dict[str, Case]:
    """Every case by its key."""
    cases = [*_polynomial_cases(), *_series_cases(), *_impulse_cases(), *_continuous_cases()]
    cases += [*_state_space_cases(), *_nonparametric_cases(), *_interval_cases()]
    order = list(PROBLEMS)
    return {case.key: case for case in sorted(cases, key=lambda case: order.index(case.problem))}

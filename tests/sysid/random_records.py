"""Random small records, many of them unsuitable, and calls of every public estimator with random orders."""

import warnings
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

import sysid
from sysid import IOData

SHORTEST, LONGEST = 10, 200
"""Samples of an experiment."""

CONDITIONS = ("estimated", "zero", "backcast")

Data = IOData | list[IOData]
Call = Callable[[Data], object]


def random_record(rng: np.random.Generator) -> Data:
    """One experiment or several of 10 to 200 samples, with one or two inputs or none, and one or two outputs."""
    nu, ny = int(rng.choice([0, 1, 1, 1, 2])), int(rng.choice([1, 1, 1, 2]))
    integer = rng.random() < 0.2
    unit = 10.0 ** float(rng.choice([0.0, 0.0, 0.0, -6.0, 6.0]))
    count = int(rng.choice([1, 1, 1, 2, 3]))
    has_gaps = rng.random() < 0.2
    experiments = []
    for _ in range(count):
        samples = int(rng.integers(SHORTEST, LONGEST + 1))
        u = np.column_stack([_signal(rng, samples) for _ in range(nu)]) if nu else None
        y = np.column_stack([_output(rng, u, samples) for _ in range(ny)]) * unit
        if integer:
            y = np.round(y)
            u = None if u is None else np.round(u)
        if has_gaps:
            first = int(rng.integers(0, samples))
            y[first : first + int(rng.integers(1, 8))] = np.nan
        window = int(rng.choice([0, 0, 0, rng.integers(0, samples // 2)]))
        experiments.append(IOData(u, y, 0.1, window=window, missing=has_gaps))
    return experiments[0] if count == 1 else experiments


def _signal(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Noise, a held binary sequence, a step, a constant, zeros, a ramp, a sinusoid or a pulse (N,)."""
    time = np.arange(samples)
    held = np.repeat(rng.choice([-1.0, 1.0], samples), int(rng.integers(1, 8)))[:samples]
    signals = (
        rng.standard_normal(samples),
        held,
        np.where(time >= rng.integers(0, samples), 1.0, 0.0),
        np.full(samples, rng.standard_normal()),
        np.zeros(samples),
        0.1 * time,
        np.sin(rng.uniform(0.05, 3.0) * time),
        np.where(time == rng.integers(0, samples), 1.0, 0.0),
    )
    return signals[int(rng.choice(len(signals), p=(0.25, 0.35, 0.1, 0.04, 0.02, 0.08, 0.08, 0.08)))]


def _output(rng: np.random.Generator, u: np.ndarray | None, samples: int) -> np.ndarray:
    """A filtered input with white, coloured or no noise; sometimes a signal that has no cause (N,)."""
    if rng.random() < 0.15:
        return _signal(rng, samples)
    radius, angle = rng.uniform(0.1, 1.0), rng.uniform(0.0, np.pi)
    denominator = [1.0, -2.0 * radius * np.cos(angle), radius**2]
    noise_free = np.zeros(samples)
    if u is not None:
        noise_free = lfilter(np.append(np.zeros(int(rng.integers(0, 4))), 1.0), denominator, u[:, 0])
    noise = float(rng.choice([0.0, 1e-8, 0.1, 1.0])) * rng.standard_normal(samples)
    if rng.random() < 0.5:
        noise = lfilter([1.0, rng.uniform(-1.0, 1.0)], [1.0, -rng.uniform(-0.99, 0.99)], noise)
    return noise_free + noise


def random_calls(rng: np.random.Generator) -> dict[str, Call]:
    """A call of each estimator, by its name, with orders of 0 to 4 and delays of 0 to 3."""
    na, nc, nd, nf = (int(n) for n in rng.integers(0, 5, 4))
    nb, nk, order = int(rng.integers(1, 5)), int(rng.integers(0, 4)), int(rng.integers(1, 5))
    options = {
        "coloured": bool(rng.random() < 0.2),
        # few steps: what the searches refuse or break does not wait for the minimum
        "max_iterations": 8,
        "initial_conditions": str(rng.choice(CONDITIONS, p=(0.75, 0.15, 0.1))),
    }
    kernel = ("tc", "dc", "ss", None)[int(rng.integers(0, 4))]
    process = ("P1", "P2", "P1D", "P1I", "P2Z")[int(rng.integers(0, 5))]
    direct = nk == 0
    return {
        "ar": lambda data: sysid.ar(data, order),
        "arma": lambda data: sysid.arma(data, na, nc, **options),
        "armax": lambda data: sysid.armax(data, na, nb, nc, nk, **options),
        "arx": lambda data: sysid.arx(data, na, nb, nk, coloured=options["coloured"]),
        "arx with a prior": lambda data: sysid.arx(data, na, nb, nk, regularisation=kernel),
        "auto": lambda data: sysid.auto(data, largest=3),
        "bj": lambda data: sysid.bj(data, nb, nc, nd, nf, nk, **options),
        "bla": lambda data: sysid.bla(data, 5 * order),
        "covf": lambda data: sysid.covf(data, lags=order),
        "cra": lambda data: sysid.cra(data),
        "cross_validate": lambda data: sysid.cross_validate(lambda part: sysid.arx(part, na, nb, nk), data, folds=3),
        "delayest": lambda data: sysid.delayest(data, largest=5, na=na, nb=nb),
        "era": lambda data: sysid.era(_first(data).y, order),
        "era_dc": lambda data: sysid.era_dc(_first(data).y, order),
        "etfe": lambda data: sysid.etfe(data, smoothing=nb),
        "feedback": lambda data: sysid.feedback(data),
        "impulseest": lambda data: sysid.impulseest(data, 10, nk, kernel=kernel),
        "iv4": lambda data: sysid.iv4(data, na, nb, nk),
        "ivx": lambda data: sysid.ivx(data, na, nb, nk, [e.y for e in _experiments(data)]),
        "lpm": lambda data: sysid.lpm(data, degree=nd, denominator=nf),
        "model_error": lambda data: sysid.model_error(sysid.arx(data, na, nb, nk), data, [0.01, 0.1]),
        "n4sid": lambda data: sysid.n4sid(data, order, direct=direct),
        "oe": lambda data: sysid.oe(data, nb, nf, nk, **options),
        "okid": lambda data: sysid.okid(data, order, p=2 * order, direct=direct),
        "order_of_excitation": lambda data: sysid.order_of_excitation(_first(data).y),
        "pbsid": lambda data: sysid.pbsid(data, order, direct=direct),
        "pem_ss": lambda data: sysid.pem_ss(data, order, direct=direct, coloured=options["coloured"]),
        "polyest": lambda data: sysid.polyest(data, na, nb, nc, nd, nf, nk, **options),
        "procest": lambda data: sysid.procest(data, process),
        "rarmax": lambda data: sysid.rarmax(_first(data), na, nb, nc, nk),
        "rarx": lambda data: sysid.rarx(_first(data), na, nb, nk),
        "resid": lambda data: sysid.resid(sysid.arx(data, na, nb, nk), data),
        "roe": lambda data: sysid.roe(_first(data), nb, nf, nk),
        "selstruc": lambda data: sysid.selstruc(data, range(1, 3), range(1, 3), range(2)),
        "spa": lambda data: sysid.spa(data),
        "spafdr": lambda data: sysid.spafdr(data),
        "structure_scan": lambda data: sysid.structure_scan(sysid.oe, data, ("nb", "nf"), [(1, 1), (nb, nf)]),
        "tfest": lambda data: sysid.tfest(data, order),
        "track": lambda data: sysid.track(_first(data), order, max(nk, 1), calibration=2.0),
        "two_stage": lambda data: sysid.two_stage(data, nb, nf, nk, [e.u for e in _experiments(data)]),
        "welch": lambda data: sysid.welch(data),
    }


def _experiments(data: Data) -> list[IOData]:
    return [data] if isinstance(data, IOData) else data


def _first(data: Data) -> IOData:
    return _experiments(data)[0]


def failure(call: Call, data: Data) -> str | None:
    """What a call ends in other than a result or a refusal: the exception or the numerical warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        # overflow and division by zero are faults that a later NaN would show, if at all, without its cause
        warnings.simplefilter("error", RuntimeWarning)
        try:
            call(data)
        except sysid.SysidError:
            return None
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    return None

"""How often the residual tests reject the true model: nominally 1 %, or whatever level is asked for.

Run by hand: `python tests/benchmarks/residual_test_size.py [draws]`. Per case it writes the rates at which whiteness
and independence are rejected at 1 % and 5 %, and the part of single lags outside the bounds.
"""

import sys
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials, StateSpace
from sysid.models import innovations_form

ONE = np.ones(1)
DT = 0.02
ARMAX = innovations_form(Polynomials([1, -1.5, 0.7], [0, 1, 0.5], [1, -1.0, 0.2], ONE, ONE), DT)
OE = innovations_form(Polynomials(ONE, [0, 1.0], ONE, ONE, [1, -0.8]), DT)
BURN_IN = 300


def armax(rng: np.random.Generator, samples: int, hold: int) -> IOData:
    """White innovations, held binary input."""
    n = samples + BURN_IN
    u = np.repeat(rng.choice([-1.0, 1.0], n // hold + 1), hold)[:n]
    y = lfilter([0, 1, 0.5], [1, -1.5, 0.7], u) + lfilter([1, -1.0, 0.2], [1, -1.5, 0.7], rng.standard_normal(n))
    return IOData(u, y, DT)[BURN_IN:]


def output_error(rng: np.random.Generator, samples: int, hold: int) -> IOData:
    """The same with a coloured disturbance: independent of the input, but not white."""
    n = samples + BURN_IN
    u = np.repeat(rng.choice([-1.0, 1.0], n // hold + 1), hold)[:n]
    y = lfilter([0, 1.0], [1, -0.8], u) + lfilter([1.0], [1, -0.9], rng.standard_normal(n))
    return IOData(u, y, DT)[BURN_IN:]


CASES: list[tuple[str, StateSpace, Callable[[np.random.Generator, int, int], IOData], int, int]] = [
    ("armax, white input, N = 250", ARMAX, armax, 250, 1),
    ("armax, input held 5, N = 250", ARMAX, armax, 250, 5),
    ("armax, white input, N = 1000", ARMAX, armax, 1000, 1),
    ("armax, input held 5, N = 1000", ARMAX, armax, 1000, 5),
    ("oe, coloured noise, white input, N = 400", OE, output_error, 400, 1),
    ("oe, coloured noise, input held 5, N = 1000", OE, output_error, 1000, 5),
]


def measure(draws: int) -> dict[str, dict[str, float]]:
    """Rates of rejection per case."""
    out = {}
    for name, model, draw, samples, hold in CASES:
        white, independent, lags, cross_lags = [], [], [], []
        for seed in range(draws):
            test = sysid.resid(model, draw(np.random.default_rng(seed), samples, hold))
            white.append(test.whiteness_p[0])
            independent.append(test.independence_p[0, 0])
            lags.append(test.outside_whiteness[0] / 25)
            cross_lags.append(test.outside_independence[0, 0] / 26)
        out[name] = {
            "whiteness 1 %": float(np.mean(np.array(white) < 0.01)),
            "whiteness 5 %": float(np.mean(np.array(white) < 0.05)),
            "independence 1 %": float(np.mean(np.array(independent) < 0.01)),
            "independence 5 %": float(np.mean(np.array(independent) < 0.05)),
            "lags outside": float(np.mean(lags)),
            "cross lags outside": float(np.mean(cross_lags)),
        }
    return out


def main() -> None:
    """Print the table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    error = 100 * np.sqrt(0.01 * 0.99 / draws)
    print(f"{draws} draws, standard error at 1 %: {error:.2f} %")
    for name, figures in measure(draws).items():
        print(name)
        for figure, value in figures.items():
            print(f"  {figure:20s} {100 * value:6.2f} %")


if __name__ == "__main__":
    main()

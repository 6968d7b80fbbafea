"""How often the residual tests reject the true model: nominally 1 %, or whatever level is asked for.

Per case it writes the rates at which whiteness and independence are rejected at 1 % and 5 %, and the part of single
lags outside the bounds. The output error has a coloured disturbance: independent of the input, but not white.
"""

import sys

import numpy as np
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials
from sysid.models import innovations_form

ONE = np.ones(1)
DT = 0.02
SYSTEMS = {
    "armax": (Polynomials([1, -1.5, 0.7], [0, 1, 0.5], [1, -1.0, 0.2], ONE, ONE), [1, -1.0, 0.2], [1, -1.5, 0.7]),
    "oe": (Polynomials(ONE, [0, 1.0], ONE, ONE, [1, -0.8]), [1.0], [1, -0.9]),
}
"""Model, and numerator and denominator of the disturbance that is drawn."""

BURN_IN = 300
CASES = (
    ("armax, white input, N = 250", 250, 1),
    ("armax, input held 5, N = 250", 250, 5),
    ("armax, white input, N = 1000", 1000, 1),
    ("armax, input held 5, N = 1000", 1000, 5),
    ("oe, coloured noise, white input, N = 400", 400, 1),
    ("oe, coloured noise, input held 5, N = 1000", 1000, 5),
)


def draw(seed, polynomials, numerator, denominator, samples, hold):
    """A record with held binary input."""
    rng, n = np.random.default_rng(seed), samples + BURN_IN
    u = np.repeat(rng.choice([-1.0, 1.0], n // hold + 1), hold)[:n]
    clean = lfilter(polynomials.B, np.convolve(polynomials.A, polynomials.F), u)
    return IOData(u, clean + lfilter(numerator, denominator, rng.standard_normal(n)), DT)[BURN_IN:]


def rates(name, samples, hold, draws):
    """Rates of rejection of a case."""
    polynomials, *colour = SYSTEMS[name.partition(",")[0]]
    model = innovations_form(polynomials, DT)
    tests = [sysid.resid(model, draw(seed, polynomials, *colour, samples, hold)) for seed in range(draws)]
    p_values = {"whiteness": [test.whiteness_p[0] for test in tests]}
    p_values["independence"] = [test.independence_p[0, 0] for test in tests]
    for test, p in p_values.items():
        for percent in (1, 5):
            yield f"{test} {percent} %", np.mean(np.array(p) < percent / 100)
    yield "lags outside", np.mean([test.outside_whiteness[0] / 25 for test in tests])
    yield "cross lags outside", np.mean([test.outside_independence[0, 0] / 26 for test in tests])


def main():
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    error = 100 * np.sqrt(0.01 * 0.99 / draws)
    print(f"{draws} draws, standard error at 1 %: {error:.2f} %")
    for name, samples, hold in CASES:
        print(name)
        for figure, value in rates(name, samples, hold, draws):
            print(f"  {figure:20s} {100 * value:6.2f} %")


if __name__ == "__main__":
    main()

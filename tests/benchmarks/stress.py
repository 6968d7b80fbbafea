"""Random systems against the best known optimum: how often does the search stop short of it?

Systems have order 2 to 6, poles up to 0.985, nk 1 to 3 and a binary input that is held for 1, 2 or 5 samples. A search
counts as off where N (V - V*) / V* > 20, V* the lesser of its own minimum and that reached from the true parameters.
Per structure the script writes how many were off, not stable or not converged, the worst distance and the times taken.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

import sysid
from sysid.design import maximum_length_sequence
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.prediction_error import admissible, minimise
from sysid.polynomial.structures import STRUCTURES
from tests.benchmarks.tables import options, timed
from tests.sysid.systems import random_polynomial

BURN_IN = 500
OFF = 20.0
KINDS = ("armax", "oe", "bj")


@dataclass(frozen=True, eq=False)
class Case:
    """A record, the structure to fit and the parameters that made it."""

    data: sysid.IOData
    orders: Orders
    theta: np.ndarray


def make_case(kind, seed, samples, snr_db):
    """Draw a system of one structure and a record of it in steady state."""
    rng = np.random.default_rng(seed)
    order, nk, hold = int(rng.integers(2, 7)), int(rng.integers(1, 4)), int(rng.choice([1, 2, 5]))
    one = np.ones(1)
    dynamics = random_polynomial(rng, order, 0.985)
    b = np.concatenate((np.zeros(nk), rng.standard_normal(order)))
    u = maximum_length_sequence(samples + BURN_IN, 12, clock=hold)
    clean = lfilter(b, dynamics, u)
    colour = random_polynomial(rng, order if kind == "armax" else 2, 0.9)
    ar = random_polynomial(rng, 2, 0.95)
    c, d = {"armax": (colour, dynamics), "oe": (one, one), "bj": (colour, ar)}[kind]
    v = lfilter(c, d, rng.standard_normal(samples + BURN_IN))
    v *= np.std(clean[BURN_IN:]) / np.std(v[BURN_IN:]) / 10 ** (rng.uniform(*snr_db) / 20)
    data = sysid.IOData(u[BURN_IN:], (clean + v)[BURN_IN:], 1.0)
    if kind == "armax":
        orders = make_orders(1, na=order, nb=order, nc=order, nk=nk)
        return Case(data, orders, orders.join(dynamics, [b], c))
    orders = make_orders(1, nb=order, nc=len(c) - 1, nd=len(d) - 1, nf=order, nk=nk)
    return Case(data, orders, orders.join(one, [b], c, d, [dynamics]))


def summary(fits):
    """Figures of many fits: how many were off, the distances and times, and how many the other marks apply to."""
    distances, seconds, converged, *marks = ([fit[name] for fit in fits] for name in fits[0])
    return {
        "systems": len(fits),
        "off": int(np.sum(np.array(distances) > OFF)),
        "worst distance": float(np.max(distances)),
        "not converged": len(fits) - int(np.sum(converged)),
        **{name: int(np.sum(values)) for name, values in zip(list(fits[0])[3:], marks, strict=True)},
        "median ms": 1e3 * float(np.median(seconds)),
        "longest ms": 1e3 * float(np.max(seconds)),
    }


def measure(kind, first, systems, samples, snr_db):
    """Fit every system and compare with the minimum beside the truth."""
    fits = []
    for seed in range(first, first + systems):
        case = make_case(kind, seed, samples, snr_db)
        orders = (getattr(case.orders, name) for name in STRUCTURES[kind])
        estimate, seconds = timed(getattr(sysid, kind), case.data, *orders)
        cost = estimate.diagnostics["sum_of_squares"]
        reference = minimise([case.data], case.orders, case.theta, max_iterations=200).at.cost
        best = min(cost, reference)
        distance = estimate.diagnostics["rows"] * (cost - best) / best
        if distance > OFF:
            how = f"start {estimate.diagnostics['start']}, {estimate.diagnostics['reason']}"
            drawn = f"order {max(case.orders.nb)}, nk {case.orders.nk[0]}"
            print(f"{kind:6s} system {seed}: {drawn}, distance {distance:.4g}, {how}")
        fits.append({"distance": distance, "seconds": seconds, "converged": estimate.diagnostics["converged"]})
        # ARMAX constrains C alone; a stable predictor is what must never be lost
        fits[-1]["predictor unstable"] = not admissible(case.orders, estimate.parameters)
        fits[-1]["diverged"] = not (np.isfinite(cost) and cost <= float(np.sum(case.data.y**2)))
    return summary(fits)


def main():
    parser = options(__doc__)
    parser.add_argument("--systems", type=int, default=100, help="random systems of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the first system; the others follow")
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--snr", type=float, nargs=2, default=(5.0, 20.0), metavar="DB", help="lowest and highest")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", sysid.SysidWarning)
    for kind in KINDS:
        for figure, value in measure(kind, asked.seed, asked.systems, asked.samples, tuple(asked.snr)).items():
            print(f"{kind:6s}{figure:20s}{value:10.4g}", flush=True)


if __name__ == "__main__":
    main()

"""Coverage of 95 % intervals from few samples, and what the warnings of the estimate catch.

Each record has a system of its own class: one with separate roots of C and D, one where they nearly cancel, and random
ones. Those of `arma` are the disturbances alone: A in place of D, in the columns of the noise model. B and F of `oe`,
and A, B and C of `armax`, nearly cancel in the systems with a common root. Per structure and length the table has the
share of coefficients whose interval holds the truth, of the input path (A, B, F) and of the noise model (C, D), the
share of records with a warning of short intervals, and the coverages in those without and with one.

    python tests/benchmarks/short_records.py [--records 200] [--lengths 80 200 800] [--seed 0] [--structures bj]
"""

import argparse
import warnings

import numpy as np
from scipy.signal import lfilter

import sysid
from sysid import IOData
from tests.benchmarks.tables import heading, row

A, B = np.array([1.0, -1.5, 0.7]), np.array([0.0, 1.0, 0.5])
NOISE = {
    "separate": (np.array([1.0, 0.5, 0.1]), np.array([1.0, -1.2, 0.6])),
    "nearly cancelling": (np.array([1.0, -0.7, 0.25]), np.array([1.0, -0.8, 0.3])),
}
"""Polynomials C and D of each kind of noise; those of random ones are drawn for each record."""

COMMON_ROOT = (np.array([0.0, 1.0, -0.3]), np.poly([0.8, 0.36]), np.poly([0.3, -0.3]))
"""B, F or A, and C of systems that a root less of each describes nearly as well."""

KINDS = {
    "oe": ("random", "common root"),
    "armax": (*NOISE, "random", "common root"),
    "bj": (*NOISE, "random"),
    "arma": (*NOISE, "random"),
}
"""Kinds of systems of each structure."""

RATIO = 0.3
"""Standard deviation of the noise over that of the output without it."""

SHORT = ("few", "memory", "edge of stability", "nearly cancel", "nearly share")
"""Words of the warnings of short intervals."""


def random_roots(rng, largest):
    """Monic polynomial of degree two, a pair of roots or two real ones inside a radius."""
    if rng.random() < 0.5:
        radius, angle = largest * np.sqrt(rng.random()), rng.uniform(0.0, np.pi)
        return np.array([1.0, -2.0 * radius * np.cos(angle), radius**2])
    return np.poly(rng.uniform(-largest, largest, 2))


def estimated(structure, kind, samples, rng):
    """Estimate of one record, and the true coefficients in the sequence of its parameters."""
    b, f, (c, d) = B, A, NOISE.get(kind, (None, None))
    if kind == "common root":
        b, f, c = COMMON_ROOT
    if kind == "random":
        f, c, d = random_roots(rng, 0.95), random_roots(rng, 0.9), random_roots(rng, 0.9)
    if structure == "armax":
        d = f
    u, e = rng.standard_normal((2, samples + 300))
    noise_free = lfilter(b, f, u)
    noise = e if structure == "oe" else lfilter(c, d, e)
    if structure == "arma":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return sysid.arma(IOData(None, noise[300:], 1.0), 2, 2), np.concatenate((d[1:], c[1:]))
    y = (noise_free + RATIO * noise_free.std() / noise.std() * noise)[300:]
    record = IOData(u[300:], y, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if structure == "oe":
            return sysid.oe(record, 2, 2), np.concatenate((b[1:], f[1:]))
        if structure == "armax":
            return sysid.armax(record, 2, 2, 2), np.concatenate((f[1:], b[1:], c[1:]))
        # parameters of Box-Jenkins models are those of B, C, D and F
        truth = np.concatenate((b[1:], c[1:], d[1:], f[1:]))
        return sysid.bj(record, 2, 2, 2, 2), truth


def places_of_noise(structure):
    """Places of the coefficients of the noise model."""
    return {"oe": [], "armax": [4, 5], "bj": [2, 3, 4, 5], "arma": [0, 1, 2, 3]}[structure]


def measure(structure, kind, samples, records, seed):
    """Coverages of path and noise model, share with a warning, and coverages without and with one."""
    held, warned = [], []
    for k in range(records):
        rng = np.random.default_rng((seed, samples, k))
        estimate, truth = estimated(structure, kind, samples, rng)
        deviation = np.sqrt(np.diag(estimate.covariance))
        held.append(np.abs(estimate.parameters - truth) <= 1.96 * deviation)
        messages = estimate.diagnostics["warnings"]
        warned.append(any(word in message for message in messages for word in SHORT))
    held, warned = np.array(held), np.array(warned)
    noise = np.isin(np.arange(held.shape[1]), places_of_noise(structure))
    groups = []
    for records_of_group in (held, held[~warned], held[warned]):
        groups += [records_of_group[:, ~noise], records_of_group[:, noise]]
    coverages = [float(group.mean()) if group.size else np.nan for group in groups]
    return *coverages[:2], float(warned.mean()), *coverages[2:]


def main():
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--lengths", type=int, nargs="+", default=[80, 200, 800])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--structures", nargs="+", default=list(KINDS), choices=list(KINDS))
    asked = parser.parse_args()
    columns = ["path", "noise model", "warned"]
    columns += ["path, not warned", "noise model, not warned", "path, warned", "noise model, warned"]
    heading("structure", "system", "samples", *columns)
    for structure in asked.structures:
        for kind in KINDS[structure]:
            for samples in asked.lengths:
                figures = measure(structure, kind, samples, asked.records, asked.seed)
                cells = ["–" if np.isnan(figure) else f"{figure:.3f}" for figure in figures]
                row(structure, kind, str(samples), *cells)


if __name__ == "__main__":
    main()

"""Entries of other packages, each at its best documented settings."""

from scenarios.bench_contract.contestant import Contestant
from scenarios.contestants.entry import Entry

INSTALL = "pip install 'hmtb-twin[peers]'"
ROOM = "scenarios.contestants"


def _entry(
    file: str, function: str, structure: str, method: str | None, settings: str, package: str, module: str
) -> Entry:
    contestant = Contestant(
        f"{file}_{function}", f"{ROOM}.{file}:{function}", structure=structure, method=method, settings=settings
    )
    return Entry(contestant, package=package, module=module, install=INSTALL)


def _pysib(structure: str, method: str, settings: str) -> Entry:
    return _entry("pysib", structure, structure, method, settings, "pysib", "pysib")


def _sippy(function: str, structure: str, method: str, settings: str) -> Entry:
    return _entry("sippy", function, structure, method, settings, "sippy-unipi", "sippy_unipi")


FILTERED = "Newton's method from ARX; anew with filtered data where the predictor is not stable, as its warning advises"
IPOPT = "optimisation by IPOPT (OPT), 200 iterations; no constraint of stability"
ROWS = "block rows 20, or twice the order where that is more"

PEERS = (
    _pysib("arx", "least_squares", "as it comes"),
    _pysib("armax", "pem", FILTERED),
    _pysib("oe", "pem", FILTERED),
    _pysib("bj", "pem", FILTERED),
    _sippy("arx", "arx", "least_squares", "linear least squares (LLS)"),
    _sippy("armax", "armax", "pem", IPOPT),
    _sippy("oe", "oe", "pem", IPOPT),
    _sippy("bj", "bj", "pem", IPOPT),
    _sippy("n4sid", "ss", "subspace", f"{ROWS}; D = 0; orders, where they are open, by its BIC"),
    _entry(
        *("python_control", "era", "ss", "observer"),
        "markov with 200 values, truncate=True, and eigensys_realization with a square Hankel matrix of all of them",
        *("control", "control"),
    ),
    _entry(
        *("slicot", "n4sid", "ss", "subspace"),
        f"{ROWS}; factor by Cholesky; orders, where they are open, at the largest gap of singular values; no gain",
        *("ctrlsys", "ctrlsys"),
    ),
    _entry(
        *("slicot", "moesp", "ss", "subspace"),
        f"{ROWS}; factor by Cholesky, B and D the MOESP way; orders at the largest gap of singular values; no gain",
        *("ctrlsys", "ctrlsys"),
    ),
    _entry(
        *("nfoursid", "n4sid", "ss", "subspace"),
        f"{ROWS}; Kalman gain from its covariances",
        *("nfoursid", "nfoursid"),
    ),
    _entry(
        *("jax_sysid", "oe", "oe", "pem"),
        "64 bits, channels scaled to one, L-BFGS of 2000 steps, no penalties, initial state fitted, one start",
        *("jax-sysid", "jax_sysid"),
    ),
    _entry(
        *("sysidentpy", "arx", "arx", "least_squares"),
        "FROLS with LeastSquares, polynomials of degree 1; terms, where orders are open, by BIC",
        *("sysidentpy", "sysidentpy"),
    ),
    _entry(
        *("sysidentpy", "armax", "armax", None),
        "FROLS with LeastSquares(unbiased=True): extended least squares, 60 rounds, polynomials of degree 1",
        *("sysidentpy", "sysidentpy"),
    ),
)
"""Python packages beside ours."""

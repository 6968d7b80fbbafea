"""Entries of other packages, each at its best documented settings."""

from pathlib import Path

from scenarios.estimators.catalogue_entry import Entry
from scenarios.estimators.contestant import Contestant

INSTALL = "pip install 'hmtb-twin[peers]'"
INSTALL_OCTAVE = "apt-get install octave octave-control"
OCTAVE = Path(__file__).parent / "octave"

Row = tuple[str, str, str | None, str]
"""Function, structure, method, settings."""


def _python(label: str, file: str, package: str, module: str, *rows: Row) -> tuple[Entry, ...]:
    """Functions of a file of this folder, which needs a package."""
    return tuple(
        Entry(
            Contestant(
                f"{label}-{function}",
                f"scenarios.contestants.{file}:{function}",
                structure=structure,
                method=method,
                settings=settings,
            ),
            package=package,
            module=module,
            install=INSTALL,
        )
        for function, structure, method, settings in rows
    )


def _octave(*rows: Row) -> tuple[Entry, ...]:
    """Functions of the folder `octave`, which need a package of Octave's."""
    return tuple(
        Entry(
            Contestant(
                f"octave-{function}",
                f"octave-cli --quiet --norc main.m {function} {{mat}} {{task}} {{model}}",
                program=True,
                stays=True,
                structure=structure,
                method=method,
                settings=settings,
                home=str(OCTAVE),
            ),
            octave="control",
            install=INSTALL_OCTAVE,
        )
        for function, structure, method, settings in rows
    )


FILTERED = "search from ARX; anew with filtered data where the predictor is not stable, as its warning advises"
IPOPT = "optimisation by IPOPT (OPT), 200 iterations, no constraint of stability"
ROWS = "block rows 20, or twice the order where that is more"
GAP = "orders, where they are open, at the largest gap of singular values"

PEERS = (
    *_python(
        *("pysib", "pysib", "pysib", "pysib"),
        ("arx", "arx", "least_squares", "as it comes"),
        ("armax", "armax", "pem", FILTERED),
        ("oe", "oe", "pem", FILTERED),
        ("bj", "bj", "pem", FILTERED),
    ),
    *_python(
        *("sippy", "sippy", "sippy-unipi", "sippy_unipi"),
        ("arx", "arx", "least_squares", "linear least squares (LLS)"),
        ("armax", "armax", "pem", IPOPT),
        ("oe", "oe", "pem", IPOPT),
        ("bj", "bj", "pem", IPOPT),
        ("n4sid", "ss", "subspace", f"{ROWS}; D = 0; orders, where they are open, by its BIC"),
    ),
    *_python(
        *("control", "python_control", "control", "control"),
        (
            "era",
            "ss",
            "observer",
            "markov of 200 values, truncate=True; eigensys_realization, its Hankel matrix of all",
        ),
    ),
    *_python(
        *("slicot", "slicot", "ctrlsys", "ctrlsys"),
        ("moen4", "ss", "subspace", f"{ROWS}; factor by Cholesky; {GAP}; no gain"),
        ("n4sid", "ss", "subspace", f"{ROWS}; factor by Cholesky; {GAP}; no gain"),
        ("moesp", "ss", "subspace", f"{ROWS}; factor by Cholesky, B and D the MOESP way; {GAP}; no gain"),
    ),
    *_python(
        *("nfoursid", "nfoursid", "nfoursid", "nfoursid"),
        ("n4sid", "ss", "subspace", f"{ROWS}; Kalman gain from its covariances"),
    ),
    *_python(
        *("jax-sysid", "jax_sysid", "jax-sysid", "jax_sysid"),
        (
            "oe",
            "oe",
            "pem",
            "64 bits, channels scaled to one, no penalties, x0 fitted; 1000 steps of Adam, 2000 of L-BFGS",
        ),
    ),
    *_python(
        *("sysidentpy", "sysidentpy", "sysidentpy", "sysidentpy"),
        ("arx", "arx", "least_squares", "FROLS with LeastSquares, degree 1; terms, where orders are open, by BIC"),
        (
            "armax",
            "armax",
            None,
            "FROLS with LeastSquares(unbiased=True): extended least squares of 60 rounds, degree 1",
        ),
    ),
    *_octave(
        ("arx", "arx", "least_squares", "as it comes"),
        ("moen4", "ss", "subspace", f"{ROWS}; {GAP}; gain from its covariances"),
    ),
)
"""Packages beside ours."""

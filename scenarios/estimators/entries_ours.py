"""Entries of this package's estimators."""

from scenarios.estimators.catalogue_entry import Entry
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.referee import REFEREE

HOME = "scenarios.estimators.ours"
BIC = "orders, where they are open, by the least BIC"
P_RULE = "p = 20 observer Markov parameters and two more per state, five equations for each unknown at least"


def _entry(name: str, structure: str | None, method: str, settings: str) -> Entry:
    label = f"our-{name.replace('_', '-')}"
    return Entry(Contestant(label, f"{HOME}:{name}", structure=structure, method=method, settings=settings))


OURS = (
    _entry("arx", "arx", "least_squares", f"{BIC} of all structures (selstruc)"),
    _entry("armax", "armax", "pem", f"initial state estimated; {BIC}, one degree for all"),
    _entry("oe", "oe", "pem", f"initial state estimated; {BIC}, one degree for all"),
    _entry("bj", "bj", "pem", f"initial state estimated; {BIC}, one degree for all"),
    _entry("iv4", "arx", "instrumental", f"{BIC} of the simulated output; no model of the noise claimed"),
    _entry("okid", "ss", "observer", f"{P_RULE}; realised by ERA; D = 0; {BIC}"),
    _entry("era", "ss", "observer", "200 values of the pulse response by least squares on past inputs; D = 0"),
    _entry("n4sid", "ss", "subspace", f"2.5 block rows per state, at least 10; D = 0; no covariance claimed; {BIC}"),
    _entry("pem_ss", "ss", "pem", f"from n4sid; D = 0; {BIC}"),
    _entry("pem", None, "pem", f"arx, armax, oe, bj or pem_ss, whichever is asked; {BIC}"),
    Entry(REFEREE),
    Entry(
        Contestant("perfect", "bench:perfect", method="pem", settings="the truth and an error of the best covariance")
    ),
)
"""The estimators of this package, the second implementation, and the perfect one that knows the truth."""

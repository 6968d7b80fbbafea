"""What theory expects of the kinds of estimators on the textbook problems."""

from itertools import product

import pytest

from scenarios.bench.theory import expectation
from scenarios.estimators.estimator import METHODS, Estimator
from sysid.polynomial.structures import STRUCTURES

CLAIMS = ("coverage", "normalised_error", "frequency_response")
ALL = {"consistency", "efficiency", *CLAIMS}
# p2 output error, p3 ARMAX, p4 Box-Jenkins, p5 equation error
CASES = {
    ("pem", "oe"): {"p2": set(), "p3": ALL - {"consistency"}, "p4": ALL - {"consistency"}},
    ("pem", "armax"): {"p2": set(), "p3": set(), "p4": set(), "p5": set()},
    ("pem", "bj"): {"p2": set(), "p3": set(), "p4": set(), "p5": set()},
    ("pem", "ss"): {"p2": set(), "p3": set(), "p4": set(), "p5": set()},
    ("least_squares", "arx"): {"p2": ALL, "p3": ALL, "p4": ALL, "p5": set()},
    ("instrumental", "arx"): {"p3": {"efficiency", *CLAIMS}, "p5": {"efficiency"}},
    ("subspace", "ss"): {"p2": {"efficiency"}, "p5": {"efficiency"}},
    ("observer", "ss"): {"p2": ALL, "p5": ALL},
}


def expected(metric, name, structure=None, method=None):
    return expectation(Estimator("one", "a:b", structure=structure, method=method), name, metric)


@pytest.mark.parametrize(("method", "structure"), CASES)
def test_expected_failures(method, structure):
    for name, fails in CASES[method, structure].items():
        expectations = {metric: expected(metric, name, structure, method) for metric in ALL}
        assert {metric for metric, one in expectations.items() if not one.passes} == fails
        assert all("[" in one.why for one in expectations.values() if not one.passes)


def test_without_method_or_without_noise_everything_is_expected():
    assert all(expected(metric, "p3", structure).passes for metric in ALL for structure in (None, *STRUCTURES))
    assert all(expected(metric, "p3", method="pem").passes for metric in ALL)
    for method, structure in product(METHODS, STRUCTURES):
        assert expected("noise_free_recovery", "quiet-2-1", structure, method).passes


def test_feedback():
    kinds = (*CASES, ("pem", "arx"))
    biased = {(method, kind) for method, kind in kinds if not expected("bias", "feedback", kind, method).passes}
    assert {("instrumental", "arx"), ("subspace", "ss"), ("observer", "ss"), ("pem", "oe")} <= biased
    assert not biased & {("pem", "armax"), ("pem", "bj"), ("pem", "ss")}

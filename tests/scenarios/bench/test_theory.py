"""What theory expects of the kinds of estimators on the textbook problems."""

import pytest

from scenarios.bench.theory import CLAIMS, expectation
from scenarios.estimators.estimator import METHODS, Estimator
from scenarios.estimators.task import STRUCTURES

ALL = {"consistency", "efficiency", *CLAIMS}
# p2 output error, p3 ARMAX, p4 Box-Jenkins, p5 equation error
CASES: dict[tuple[str, str], dict[str, set[str]]] = {
    ("pem", "oe"): {"p2": set(), "p3": ALL - {"consistency"}, "p4": ALL - {"consistency"}},
    ("pem", "armax"): {"p2": set(), "p3": set(), "p4": set(), "p5": set()},
    ("pem", "bj"): {"p2": set(), "p3": set(), "p4": set(), "p5": set()},
    ("pem", "ss"): {"p2": set(), "p3": set(), "p4": set(), "p5": set()},
    ("least_squares", "arx"): {"p2": ALL, "p3": ALL, "p4": ALL, "p5": set()},
    ("instrumental", "arx"): {"p3": {"efficiency", *CLAIMS}, "p5": {"efficiency"}},
    ("subspace", "ss"): {"p2": {"efficiency"}, "p5": {"efficiency"}},
    ("observer", "ss"): {"p2": ALL, "p5": ALL},
}


@pytest.mark.parametrize(("method", "structure"), CASES)
def test_what_fails(method: str, structure: str) -> None:
    contestant = Estimator("one", "a:b", structure=structure, method=method)
    for name, fails in CASES[method, structure].items():
        said = {figure: expectation(contestant, name, figure) for figure in ALL}
        assert {figure for figure, found in said.items() if not found.passes} == fails
        assert all("[" in found.why for found in said.values() if not found.passes)


@pytest.mark.parametrize("figure", sorted(ALL))
def test_everything_is_expected_of_who_does_not_say_the_method(figure: str) -> None:
    for structure in (None, *STRUCTURES):
        assert expectation(Estimator("one", "a:b", structure=structure), "p3", figure).passes
    assert expectation(Estimator("one", "a:b", method="pem"), "p3", figure).passes


@pytest.mark.parametrize("method", METHODS)
def test_every_method_recovers_what_has_no_noise(method: str) -> None:
    for structure in STRUCTURES:
        contestant = Estimator("one", "a:b", structure=structure, method=method)
        assert expectation(contestant, "quiet-2-1", "noise_free_recovery").passes


def test_feedback() -> None:
    biased = {
        (method, structure)
        for method, structure in (*CASES, ("pem", "arx"))
        if not expectation(Estimator("one", "a:b", structure=structure, method=method), "feedback", "bias").passes
    }
    assert {("instrumental", "arx"), ("subspace", "ss"), ("observer", "ss"), ("pem", "oe")} <= biased
    assert not biased & {("pem", "armax"), ("pem", "bj"), ("pem", "ss")}

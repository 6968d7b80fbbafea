"""A system in another structure is the same system."""

import numpy as np
import pytest

from scenarios.problems.linear_problem import underfit
from scenarios.problems.registry import problem
from sysid import Polynomials
from sysid.models import innovations_form
from sysid.polynomial.structures import embedding, layout, own_structure
from tests.refusals import refused

F_HZ = np.geomspace(0.01, 24.0, 30)
OWN = {"p1": "armax", "p2": "oe", "p3": "armax", "p4": "bj", "p5": "arx", "shared": "oe"}


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("structure", ["arx", "armax", "oe", "bj", "ss"])
def test_same_responses(name, structure):
    """From the input, and from the innovation, where the structure has the noise; its parameters make it again."""
    truth = problem(name).polynomials
    embedded = embedding(truth, structure)
    if embedded.polynomials is None:
        return
    orders = layout(structure, embedded.orders, truth.nu)
    again = orders.polynomials(orders.parameters(embedded.polynomials))
    for other in (embedded.polynomials, again):
        model, expected = innovations_form(other, 0.02), innovations_form(truth, 0.02)
        assert model.frequency_response(F_HZ) == pytest.approx(expected.frequency_response(F_HZ), rel=1e-9)
        assert model.noise_response(F_HZ) == pytest.approx(expected.noise_response(F_HZ), rel=1e-9)


def test_which_hold_the_noise():
    """The table of who holds what."""
    held = {
        name: {s for s in ("arx", "armax", "oe", "bj", "ss") if embedding(problem(name).polynomials, s).polynomials}
        for name in OWN
    }
    assert held == {
        "p1": {"armax", "bj", "ss"},
        "p2": {"armax", "oe", "bj", "ss"},
        "p3": {"armax", "bj", "ss"},
        "p4": {"armax", "bj", "ss"},
        "p5": {"arx", "armax", "bj", "ss"},
        "shared": {"armax", "oe", "bj", "ss"},
    }
    assert {name: own_structure(problem(name).polynomials) for name in OWN} == OWN


def test_orders():
    """Those that hold the truth, and those one too low."""
    orders = {s: dict(embedding(problem("p4").polynomials, s).orders) for s in ("arx", "armax", "oe", "bj", "ss")}
    assert orders == {
        "arx": {"na": 2, "nb": 2, "nk": 1},
        "armax": {"na": 4, "nb": 4, "nc": 4, "nk": 1},
        "oe": {"nb": 2, "nf": 2, "nk": 1},
        "bj": {"nb": 2, "nc": 2, "nd": 2, "nf": 2, "nk": 1},
        "ss": {"order": 4},
    }
    assert underfit(embedding(problem("p2").polynomials, "oe")) == {"nb": 1, "nf": 1, "nk": 1}
    assert underfit(embedding(Polynomials(B=[0, 1.0], F=[1, -0.5]), "oe")) is None
    # a direct term is nothing that the state-space structure has
    assert embedding(problem("published-5.8").polynomials, "ss") is None


def test_polynomials_too_long_for_their_orders():
    """Are refused, not cut."""
    orders = layout("oe", {"nb": 1, "nf": 1, "nk": 1})
    refused("3 coefficients", orders.parameters, Polynomials(B=[0, 0.1], F=[1, -0.9, 0.2]))

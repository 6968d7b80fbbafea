"""Faults that a response without noise gives away."""

import numpy as np
import pytest

import sysid
from scenarios.bench.consistency import recognised_fault

DT = 0.02
F = np.array([0.1, 0.5, 2.0, 8.0, 20.0])


def response(b: list[float], a: list[float]) -> np.ndarray:
    return sysid.models.innovations_form(sysid.Polynomials(A=a, B=b), DT).frequency_response(F)


TRUE = response([0.0, 0.2, 0.1], [1.0, -1.5, 0.7])


@pytest.mark.parametrize(
    ("b", "told"),
    [
        ([0.0, 0.0, 0.2, 0.1], "1 sample late"),
        ([0.0, 0.0, 0.0, 0.2, 0.1], "2 samples late"),
        ([0.2, 0.1], "1 sample early"),
        ([0.0, -0.2, -0.1], "of the wrong sign"),
        ([0.0, 0.204, 0.102], "1.02 times the truth"),
        ([0.0, 0.200002, 0.100001], "1.00001 times the truth"),
        ([0.0, 0.2, 0.11], ""),
    ],
)
def test_what_is_familiar_is_told(b: list[float], told: str) -> None:
    found = response(b, [1.0, -1.5, 0.7])
    assert recognised_fault([found, found], TRUE, F, DT, 1e-6) == told


def test_all_responses_must_have_it() -> None:
    assert recognised_fault([-TRUE, TRUE], TRUE, F, DT, 1e-6) == ""
    assert recognised_fault([1.02 * TRUE, 1.03 * TRUE], TRUE, F, DT, 1e-6) == ""

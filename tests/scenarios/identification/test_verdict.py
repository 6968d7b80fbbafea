"""Verdicts of `hmtb identify` on joints whose truth is known."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from scenarios.identification.order_choice import choose_and_identify, hold_out
from scenarios.identification.result_tables import model_rows, verdict
from tests.benchmarks.nonlinear_joints import joint


def identified(record, method=None):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        to_estimate, check = hold_out((replace(record, name="record"),))
        result, _ = choose_and_identify(to_estimate, method, check=check, continued=True)
    return result


@pytest.mark.parametrize(
    ("kind", "words", "advice"),
    [
        ("friction", "dry friction", "larger amplitude"),
        ("play", "play", "larger amplitude"),
        ("saturation", "saturation", "smaller amplitude"),
    ],
)
def test_a_nonlinear_joint_is_not_sufficiently_described(kind, words, advice):
    _, record = joint(np.random.default_rng([101, 0]), kind)
    result = identified(record)
    assert verdict(result).startswith(f"not sufficient: the output depends nonlinearly on the input, as with {words} (")
    assert advice in verdict(result)
    assert dict(model_rows(result))["residuals nonlinear in the input"].startswith(f"yes (like {words}, ")
    assert result.record()["nonlinearity"]["kind"] == [words]


def test_a_linear_joint_is_sufficiently_described():
    _, record = joint(np.random.default_rng([101, 1]), "linear")
    result = identified(record)
    assert verdict(result).startswith("sufficient")
    assert dict(model_rows(result))["residuals nonlinear in the input"].startswith("no (p = ")
    assert result.record()["nonlinearity"]["seen"] == [False]
    assert result.fitted.estimate.dc_gain()[0, 0] == pytest.approx(1.0, abs=0.01)

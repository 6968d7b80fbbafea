"""Printed records: a few lines that say what one wants to know first."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from sysid import IOData


@pytest.fixture(scope="module")
def data() -> IOData:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(600)
    y = np.zeros(600)
    for k in range(1, 600):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    return IOData(u, y + 0.01 * rng.standard_normal(600), 0.02, input_units=("rad",), name="robot")


def test_a_record_is_one_line(data: IOData) -> None:
    assert str(data) == "robot: 600 samples every 0.02 s; input u1 [rad]; output y1"
    assert "the first 10 to initialise" in str(IOData(data.u, data.y, 0.02, window=10))


def test_an_estimate_lists_parameters_with_their_deviations(data: IOData) -> None:
    found = sysid.oe(data, 1, 1, 1)
    first, *rest = str(found).splitlines()
    assert first.startswith("OE (")
    assert first.endswith("from 600 samples every 0.02 s")
    deviation = np.sqrt(found.covariance[0, 0])
    assert f"  {found.parameter_names[0]} = {found.parameters[0]:.6g} ± {deviation:.2g}" in rest
    assert f"  poles from input to output (z plane): {found.poles()[0].real:.4f}" in rest


def test_a_large_estimate_stays_short(data: IOData) -> None:
    found = sysid.arx(data, 10, 10, 1)
    assert "  20 parameters" in str(found)
    assert str(found).count("\n") == 4
    assert str(replace(found, diagnostics={"warnings": ("poor",)})).endswith("\n  warning: poor")


def test_fits_and_tests_say_their_verdict(data: IOData) -> None:
    found = sysid.oe(data, 1, 1, 1)
    (fit,) = sysid.compare({"mine": found}, data)
    expected = f"mine: {fit.simulation[0]:.2f} % in simulation, {fit.one_step[0]:.2f} % one step ahead"
    assert str(fit) == expected
    good, bad = sysid.resid(found, data), sysid.resid(sysid.oe(data, 1, 0, 1), data)
    assert str(good).splitlines()[2].startswith("  y1 and u1: independent (p = ")
    assert "not passed" in str(bad)
    assert "y1: not white" in str(bad)

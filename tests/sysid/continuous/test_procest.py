from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import linregress

from sysid import IOData, SysidWarning, damp, procest, simulate, tfest
from sysid.continuous.structures import ProcessPath, RealisePaths
from sysid.models.data_summary import DataSummary
from tests.refusals import refused
from tests.sysid.continuous.record import record

TRUTH = {"Kp": 2.0, "Tp1": 3.0, "Tp2": 1.0, "Tp3": 0.4, "Tw": 0.8, "Zeta": 0.3, "Tz": -0.7, "Td": 0.53}
UNDERDAMPED = [4.0], [1.0, 1.0, 4.0], 0.23, 0.1, 8


def parameters(kind):
    return np.array([TRUTH[name] for name in ProcessPath(kind).names])


def step_record(paths, *, noise=0.0, lengths=(300, 250), missing=0.0, intersample="zoh"):
    """Experiments in mid-motion of paths (rows per output), each with the true parameters of its kind."""
    rng = np.random.default_rng(0)
    structures = tuple(tuple(map(ProcessPath, row)) for row in paths)
    theta = np.concatenate([parameters(kind) for row in paths for kind in row])
    names = IOData(np.zeros((9, len(paths[0]))), np.zeros((9, len(paths))), 0.1)
    model = RealisePaths(structures, DataSummary.of([names]), intersample, np.eye(len(paths)))(theta).sampled()
    experiments = []
    for n in lengths:
        u = np.repeat(rng.choice([-1.0, 1.0], (n // 5 + 20, len(paths[0]))), 5, axis=0)[: n + 60]
        y = simulate(model, u)
        y += noise * rng.standard_normal(y.shape)
        y[rng.random(y.shape) < missing] = np.nan
        experiments.append(IOData(u[60:], y[60:], 0.1, intersample=intersample, missing=missing > 0.0))
    return experiments, theta


@pytest.mark.parametrize(
    "kind", [f"P{n}{z}{i}" + "U" * (n > 1) for n, z, i in product((1, 2, 3), ("", "Z"), ("", "I"))]
)
def test_coefficients_have_exact_derivatives(kind):
    structure, theta, step = ProcessPath(kind + "D"), parameters(kind + "D"), 1e-6

    def coefficients(theta):
        path = structure.transfer(theta)
        return np.concatenate((path.b, path.a, [path.delay]))

    for column, direction in zip(structure.jacobian(theta).T, step * np.eye(len(theta)), strict=True):
        difference = (coefficients(theta + direction) - coefficients(theta - direction)) / (2 * step)
        np.testing.assert_allclose(column, difference, atol=1e-8)
    np.testing.assert_allclose(structure.parameters(structure.transfer(theta)), theta, rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind, intersample",
    [("P1D", "zoh"), ("P2DZU", "foh"), ("P3Z", "zoh"), ("P2DZI", "foh"), ("P0I", "zoh"), ("P3DU", "zoh")],
)
def test_exact_recovery(kind, intersample):
    (data,), theta = step_record([[kind]], lengths=(400,), intersample=intersample)
    np.testing.assert_allclose(procest(data, kind).parameters, theta, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("paths", [[["P1I", "P1"]], [["P1"], ["P2D"]]])
def test_several_channels_experiments_and_missing_outputs(paths):
    data, theta = step_record(paths, missing=0.1)
    np.testing.assert_allclose(procest(data, paths).parameters, theta, rtol=1e-8)


def test_offsets_are_an_operating_point():
    data, theta = step_record([["P1"], ["P0"]], lengths=(120, 80), missing=0.1)
    levels = np.array([[20.0, -3.0], [25.0, 2.0]])
    estimate = procest(
        [one.subtract(y=-level) for one, level in zip(data, levels, strict=True)], [["P1"], ["P0"]], offset=True
    )
    np.testing.assert_allclose(estimate.parameters, theta, rtol=1e-8)
    np.testing.assert_allclose(estimate.diagnostics["offsets"], levels.T, rtol=1e-8)
    np.testing.assert_allclose(estimate.operating_point[1], [0.0, 0.0], atol=1e-6)
    refused("the free initial state of an integrator is a constant", procest, data, "P1I", offset=True)


def test_a_gain_with_an_offset_is_a_regression_line():
    (data,), _ = step_record([["P0"]], noise=0.3, lengths=(200,))
    estimate = procest(replace(data, y=data.y + 20.0), "P0", offset=True, coloured=False)
    line = linregress(data.u[:, 0], data.y[:, 0] + 20.0)
    assert estimate.parameters[0] == pytest.approx(line.slope, rel=1e-9)
    assert estimate.covariance[0, 0] == pytest.approx(line.stderr**2, rel=1e-6)
    assert estimate.operating_point[1] == pytest.approx([line.intercept], rel=1e-9)


@pytest.mark.slow
def test_the_same_likelihood_and_intervals_as_a_transfer_function():
    data = record(*UNDERDAMPED, samples=400, noise=0.05)
    process, transfer = procest(data, "P2DU"), tfest(data, 2, 0, delay=None)
    squares = [estimate.diagnostics["sum_of_squares"] for estimate in (process, transfer)]
    assert squares[0] == pytest.approx(squares[1], rel=1e-9)
    for name in ("natural_frequency", "damping", "time_constant"):
        expected = getattr(damp(transfer), name).ci95
        np.testing.assert_allclose(getattr(damp(process), name).ci95, expected, rtol=1e-4)
    assert process.parameter_names == ("Kp", "Tw", "Zeta", "Td")
    assert "natural frequency / Hz" in str(process)


@pytest.mark.slow
def test_limits_of_a_structure_are_reported():
    oscillating = record(*UNDERDAMPED, samples=200)
    with pytest.warns(SysidWarning, match="Tp1 and Tp2 coincide.*the poles may be complex"):
        procest(oscillating, "P2")
    with pytest.warns(SysidWarning, match=r"at its limit 0\.15 s: a larger max_delay may fit better"):
        procest(oscillating, "P2DU", max_delay=0.15)
    vague = record([2.0], [0.6, 1.9, 1.0], 0.0, 0.1, 4, samples=100, noise=1.5, seed=1)
    with pytest.warns(SysidWarning, match="the interval of Tp2 reaches zero and is not reliable"):
        procest(vague, "P2")


def test_refusals():
    data = record([2.0], [1.0, 0.5], 0.0, 0.1, 4, samples=100)
    refused("P0, P1, P2 or P3 with any of D", procest, data, "P4D")
    refused("expected P1Z, got P0Z", procest, data, "P0Z")
    refused(r"one value or one per input \(1\), got", procest, data, ["P1", "P1"])
    refused("delay of a transfer function with as many zeros as poles only to whole samples", procest, data, "P1DZ")

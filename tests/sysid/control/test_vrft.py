from dataclasses import replace

import numpy as np
import pytest
import scipy
from scipy.linalg import block_diag

import sysid
from sysid import Controller, IOData, StateSpace, vrft
from sysid.models import block_diagonal
from tests.refusals import refused
from tests.sysid.control.closed_loop import DT, run, sensitivity_peak, servo

A1 = -np.array([[1.1, 0.1], [-0.05, 1.2]])
A2 = np.array([[0.3, 0.05], [0.0, 0.36]])
GAIN = np.eye(2) + A1 + A2
"""Coupled plant y(t) + A1 y(t-1) + A2 y(t-2) = GAIN u(t-2): gain 1, delay 2."""

IDEAL = np.stack([np.linalg.solve(GAIN, one) for one in (np.eye(2), A1, A2)], axis=2)
"""Its inverse u(t) = GAIN^-1 (y(t+2) + A1 y(t+1) + A2 y(t))."""


REFERENCE = block_diagonal([servo((np.log(0.8) / DT,), 1)] * 2)


def plant():
    A = np.block([[-A1, -A2, GAIN], [np.eye(2), np.zeros((2, 4))], [np.zeros((2, 6))]])
    B = np.vstack([np.zeros((4, 2)), np.eye(2)])
    return StateSpace(A, B, np.eye(2, 6), np.zeros((2, 2)), None, DT)


def record(samples=3000, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    u = scipy.signal.lfilter([0.5], [1.0, -0.5], rng.standard_normal((samples, 2)), axis=0)
    return IOData(u, sysid.simulate(plant(), u) + noise * rng.standard_normal((samples, 2)), DT)


def test_exact_recovery_of_the_ideal_controller():
    """Without noise, and with the ideal controller in the class, the loop is the one that was wanted."""
    design = vrft(record(), REFERENCE, terms=3, pole=0.0, corner=2.0)
    np.testing.assert_allclose(design.feedforward, IDEAL, atol=1e-6)
    np.testing.assert_allclose(design.feedback, IDEAL, atol=1e-6)
    np.testing.assert_allclose(design.unexplained, 0.0, atol=1e-6)
    f = np.geomspace(0.01, 24.0, 50)
    loop = design.controller.closed_loop(plant()).frequency_response(f)
    np.testing.assert_allclose(loop[:, :2, :2], REFERENCE.frequency_response(f), atol=1e-6)
    z, c = np.exp(-2j * np.pi * f * DT), np.exp(-2.0 * np.pi * 2.0 * DT)
    complementary = (z * (1.0 - c) / (1.0 - c * z)) ** 2
    np.testing.assert_allclose(-loop[:, 2:, 2:], complementary[:, None, None] * np.eye(2), atol=1e-6)


@pytest.mark.slow
def test_instruments_make_the_estimate_consistent():
    """Errors shrink as the root of the number of samples; those of least squares do not."""

    def errors(samples):
        records = (record(samples, 0.05, seed) for seed in range(6))
        designs = [vrft(one, REFERENCE, terms=3, pole=0.0, corner=3.0) for one in records]
        misses = [[d.feedforward - IDEAL, d.feedback - IDEAL] for d in designs]
        return np.sqrt(np.mean(np.square(misses), axis=(0, 2, 3, 4)))

    def least_squares(samples):
        data = record(samples, 0.05)
        lags = np.hstack([data.y[2:], data.y[1:-1], data.y[:-2]])
        found = np.linalg.lstsq(lags, data.u[:-2])[0].T.reshape(2, 3, 2).transpose(0, 2, 1)
        return np.sqrt(np.mean((found - IDEAL) ** 2))

    few, many = errors(1000), errors(16000)
    assert (many < 0.4 * few).all()
    assert least_squares(16000) > 0.8 * least_squares(1000)
    assert least_squares(16000) > 4.0 * many[0]


def test_the_coupling_enters():
    """Loop by loop, the same record gives a worse controller."""
    data, f = record(noise=0.01), np.geomspace(0.05, 3.0, 20)
    singles = [
        vrft(data.select(inputs=[i], outputs=[i]), REFERENCE.channel(i, i).input_path(), corner=1.0).controller
        for i in (0, 1)
    ]
    blocks = (block_diag(*(getattr(one, name) for one in singles)) for name in ("A", "Br", "By", "Bu", "C", "Dr", "Dy"))
    apart = Controller(*blocks, DT)
    together = vrft(data, REFERENCE, corner=1.0).controller
    errors = [
        np.abs(one.closed_loop(plant()).frequency_response(f)[:, :2, :2] - REFERENCE.frequency_response(f)).max()
        for one in (apart, together)
    ]
    assert errors[1] < 0.2 * errors[0]


@pytest.mark.parametrize("bound", [1.3, 2.0])
def test_the_sensitivity_keeps_its_bound(bound):
    design = vrft(record(noise=0.02), REFERENCE, terms=4, pole=0.2, sensitivity=bound)
    assert design.sensitivity <= bound
    assert sensitivity_peak(design.controller, plant()) == pytest.approx(design.sensitivity, rel=0.05)


def test_offsets_and_limits():
    """Levels of the record do not matter, a disturbance leaves no offset, a limited command does not wind up."""
    data = record()
    moved = replace(data, u=data.u + 3.0, y=data.y - 2.0)
    controller = vrft(moved, REFERENCE, terms=3, pole=0.0, corner=2.0).controller
    np.testing.assert_allclose(controller.closed_loop(plant()).dc_gain()[:2], np.eye(2, 4), atol=1e-8)
    requests = np.zeros((600, 2))
    requests[50:350] = 0.5
    outputs, _, _ = run(controller, plant(), requests, disturbance=0.1, rate=0.004)
    assert np.max(outputs[100:]) < 0.5 * 1.05
    np.testing.assert_allclose(outputs[300:350], 0.5, atol=1e-3)
    np.testing.assert_allclose(outputs[-50:], 0.0, atol=1e-3)


def test_feedback_presses_against_an_obstacle_with_no_more_than_the_record_has_tried():
    data, stuck = record(), replace(plant(), B=np.zeros((6, 2)))
    controller = vrft(data, REFERENCE, terms=3, pole=0.0, corner=2.0).controller
    sent = run(controller, stuck, np.full((500, 2), 0.5))[1][-1]
    np.testing.assert_allclose(sent - 0.5, 0.85 * data.u.std(axis=0), rtol=1e-3)


def test_refusals():
    data, rng = record(), np.random.default_rng(1)
    one = np.repeat(data.u[:, :1], 2, axis=1)
    for wrong, text in (
        ({"data": data.select(inputs=[0])}, "record: expected 2 inputs and outputs"),
        ({"data": data[:60]}, "samples or more"),
        ({"data": replace(data, u=np.c_[data.u[:, 0], np.ones(len(data))])}, "moving inputs"),
        ({"reference": None}, "got NoneType"),
        ({"data": replace(data, u=one, y=sysid.simulate(plant(), one))}, "excite all inputs"),
        ({"data": replace(data, y=rng.standard_normal(data.y.shape))}, "unexplained"),
        ({"reference": replace(REFERENCE, A=1.3 * REFERENCE.A)}, "stable"),
        ({"reference": replace(REFERENCE, D=np.eye(2))}, "direct term"),
        ({"reference": replace(REFERENCE, dt=0.01)}, "at 0.02 s"),
        ({"reference": block_diagonal([servo((-60.0,))] * 2)}, "within the delay"),
        ({"corner": 12.0, "sensitivity": 1.5}, "sensitivity 1.5 requested"),
        ({"instruments": 2}, "instruments"),
        ({"pole": 1.0}, "pole"),
    ):
        refused(text, vrft, **{"data": data, "reference": REFERENCE, "terms": 3, "pole": 0.0, **wrong})

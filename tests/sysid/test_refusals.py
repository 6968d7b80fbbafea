"""Input that no estimator should take, and records that stay locked."""

import contextlib
import copy
import pickle
import warnings

import numpy as np
import pytest

import sysid
from tests.sysid.refusals import refused


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    return sysid.IOData(u, np.convolve(u, [0.0, 0.5, 0.3])[:400] + 0.01 * rng.standard_normal(400), 0.02)


@pytest.fixture(scope="module")
def model(data):
    return sysid.oe(data, 2, 1)


@pytest.mark.parametrize("estimator", [sysid.arx, sysid.oe])
@pytest.mark.parametrize("orders", [(2.5, 1), (1, None), ("2", 1), (1, 1, 1.0), (1, 1, 300), (-1, 1)])
def test_orders_that_are_none(data, estimator, orders):
    with pytest.raises(sysid.SysidError):
        estimator(data, *orders)


@pytest.mark.parametrize("given", [None, 3, "data", np.zeros((10, 2))])
def test_data_that_are_none(given):
    refused("IOData", lambda: sysid.oe(given, 1, 1))


def test_long_delays_of_short_records():
    rng = np.random.default_rng(1)
    for samples in (20, 40, 80):
        u = rng.standard_normal(samples)
        record = sysid.IOData(u, rng.standard_normal(samples), 1.0)
        for nk in range(samples):
            for fit in (
                lambda r, k: sysid.oe(r, 1, 1, k, max_iterations=5),
                lambda r, k: sysid.armax(r, 1, 1, 1, k, max_iterations=5),
            ):
                with contextlib.suppress(sysid.SysidError), warnings.catch_warnings():
                    warnings.simplefilter("ignore", sysid.SysidWarning)
                    assert np.isfinite(fit(record, nk).parameters).all()


@pytest.mark.parametrize("scale", [1e160, 1e-200])
def test_signals_whose_squares_leave_the_range_of_numbers(data, scale):
    refused("change the unit", lambda: sysid.IOData(scale * data.u, data.y, data.dt))


def test_masked_samples_are_not_forgotten(data):
    refused("masked", lambda: sysid.IOData(np.ma.masked_greater(data.u, 1.0), data.y, data.dt))


def test_other_wrong_types(data, model):
    for wrong in (
        lambda: sysid.IOData(data.u, data.y, 0.02, input_names=5),
        lambda: data[1.5:3],
        lambda: sysid.spa(data, frequencies=[]),
        lambda: model.model.frequency_response(np.ones((2, 2))),
        lambda: model.model.markov(1.5),
        lambda: sysid.StateSpace.from_control(3),
        lambda: sysid.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, None),
    ):
        with pytest.raises(sysid.SysidError):
            wrong()


def test_fit_of_a_constant_output_is_refused(data, model):
    refused("constant", lambda: sysid.compare(model, sysid.IOData(data.u, np.full(400, 0.3), data.dt)))


def test_unstable_model_is_told(data):
    y = np.zeros(60)
    for k in range(1, 60):
        y[k] = 1.3 * y[k - 1] + data.u[k - 1, 0]
    with pytest.warns(sysid.SysidWarning, match="not stable"):
        estimate = sysid.arx(sysid.IOData(data.u[:60], y, 0.02), 1, 1)
    assert any("not stable" in text for text in estimate.diagnostics["warnings"])


@pytest.mark.parametrize("carry", [copy.deepcopy, lambda record: pickle.loads(pickle.dumps(record))])
def test_copies_stay_locked(data, model, carry):
    for record, field in ((data, "u"), (model.model, "A"), (model, "parameters"), (model.polynomials, "B")):
        with pytest.raises(ValueError, match="read-only"):
            getattr(carry(record), field)[...] = 0.0

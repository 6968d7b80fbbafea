"""B, D and initial states from sums over the records, against least squares on simulated columns."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid.subspace.predictor_fit as predictor_fit
from sysid import IOData, n4sid, simulate
from sysid.polynomial.fit_with_offset import unexplained_offset
from sysid.polynomial.orthonormal_basis import all_pass
from sysid.subspace.predictor_sensitivities import BlockFilters
from tests.sysid.systems import multivariable, record_in_motion


def columns_of(model, record):
    """Outputs by a unit of each entry of B and D and of each initial state, as columns (N ny, unknowns)."""
    columns = []
    for k in range(model.B.size + model.D.size + model.order):
        unit = np.zeros(model.B.size + model.D.size + model.order)
        unit[k] = 1.0
        B, D, x0 = np.split(unit, np.cumsum([model.B.size, model.D.size]))
        moved = replace(model, B=B.reshape(model.B.shape), D=D.reshape(model.D.shape), K=None)
        columns.append(simulate(moved, record.u, x0=x0).ravel())
    return np.column_stack(columns)


def test_the_fit_is_that_of_least_squares_on_simulated_columns():
    """Of one output no weight matters; the wide prior of the state hardly does."""
    record = record_in_motion(multivariable(), 2000, noise=0.3)
    record = IOData(record.u, record.y[:, :1], record.dt)
    model = n4sid(record, 4, gain=False).model
    phi = columns_of(model, record)
    solution = np.linalg.lstsq(phi, record.y.ravel(), rcond=None)[0]
    entries = np.concatenate((model.B.ravel(), model.D.ravel()))
    np.testing.assert_allclose(solution[: len(entries)], entries, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("direct", [True, False])
def test_sums_and_refined_errors_give_the_same_model(monkeypatch, direct):
    truth = multivariable(direct=direct)
    records = [record_in_motion(truth, n, seed, 0.3) for n, seed in ((900, 0), (1303, 1))]
    by_sums = n4sid(records, 4, direct=direct)
    calls = []
    monkeypatch.setattr(predictor_fit, "regression_on_inputs", lambda *arguments: calls.append(arguments))
    by_errors = n4sid(records, 4, direct=direct)
    assert calls
    np.testing.assert_allclose(by_sums.model.markov(50), by_errors.model.markov(50), atol=1e-10)


def test_noise_free_records_need_the_errors(monkeypatch):
    """Sums alone would keep half of the digits."""
    outcomes = []
    regression = predictor_fit.regression_on_inputs

    def recorded(*arguments):
        outcomes.append(regression(*arguments))
        return outcomes[-1]

    monkeypatch.setattr(predictor_fit, "regression_on_inputs", recorded)
    truth = multivariable()
    model = n4sid(record_in_motion(truth, 1000), 4).model
    assert outcomes == [None]
    np.testing.assert_allclose(model.markov(50), truth.markov(50), atol=1e-11)


@pytest.mark.parametrize("samples", [5, 8, 4096, 10_003])
def test_products_of_filtered_signals_are_those_of_the_filters(samples):
    rng = np.random.default_rng(samples)
    basis = all_pass(np.array([0.9 + 0.3j, 0.9 - 0.3j, -0.5]))
    w, e = rng.standard_normal((samples, 2)), rng.standard_normal((samples, 1))
    filters = BlockFilters.of(basis.F, basis.b, driving=2, nu=1, ny=1)
    denominator = np.poly(np.linalg.eigvals(basis.F)).real
    signals = []
    for channel in w.T:
        for i in range(3):
            numerator = [np.linalg.matrix_power(basis.F, k)[i] @ basis.b for k in range(3)]
            # Markov parameters times the denominator are the numerator
            numerator = np.convolve(denominator, numerator)[:3]
            signals.append(lfilter(np.append(0.0, numerator), denominator, channel))
    expected = np.column_stack([*signals, w[:, 0], e[:, 0]])
    np.testing.assert_allclose(filters.signals(np.hstack((w, e))), expected, atol=1e-9)
    np.testing.assert_allclose(filters.sums(np.hstack((w, e))), expected.T @ expected, atol=1e-9 * samples)


def test_errors_after_the_transient_are_summed(monkeypatch):
    """The offset of a record that outlasts its initial state, from a few rows and from all of them."""
    truth = multivariable()
    record = record_in_motion(truth, 3000, noise=0.2)
    record = replace(record, y=record.y + np.array([0.5, -0.2]), window=40)
    model = n4sid(record_in_motion(truth, 3000, noise=0.2), 4).model
    by_sums = np.hstack(unexplained_offset(model, [record]))
    module = sys.modules[unexplained_offset.__module__]
    monkeypatch.setattr(module, "_settled_error_table", lambda *arguments: None)
    by_rows = np.hstack(unexplained_offset(model, [record]))
    np.testing.assert_allclose(by_sums, by_rows, rtol=1e-9)
    np.testing.assert_allclose(by_sums[:2], [0.5, -0.2], atol=0.1)

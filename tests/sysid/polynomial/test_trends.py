import warnings
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidError
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import linearise
from sysid.polynomial.trends import best_degree

B, F = [0.0, 0.3, 0.2], [1.0, -1.2, 0.5]
GAIN = sum(B) / sum(F)

FITS = {
    "arx": partial(sysid.arx, na=2, nb=2),
    "armax": partial(sysid.armax, na=2, nb=2, nc=2),
    "oe": partial(sysid.oe, nb=2, nf=2),
    "bj": partial(sysid.bj, nb=2, nc=1, nd=1, nf=2),
    "polyest": partial(sysid.polyest, na=1, nb=2, nc=0, nd=0, nf=1),
    "oe from rest": partial(sysid.oe, nb=2, nf=2, initial_conditions="zero"),
    "bj of a stationary disturbance": partial(sysid.bj, nb=2, nc=1, nd=1, nf=2, initial_conditions="backcast"),
}


def record(seed=0, samples=500, missing=0.0):
    """A resonant path beside a slow disturbance, which determines the noise models."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 5), 5) + 0.3
    y = lfilter(B, F, u) + lfilter([1.0, 0.4], [1.0, -0.7], 0.05 * rng.standard_normal(samples))
    y[rng.random(samples) < missing] = np.nan
    return IOData(u, y, 0.1, missing=missing > 0.0)


def shifted(data, offset, slope):
    """The record with a constant and a line in its output, the slope in units a second."""
    return IOData(data.u, data.y[:, 0] + offset + slope * data.time, data.dt, missing=data.missing)


@pytest.mark.parametrize("name", FITS)
def test_a_trend_in_the_output_changes_nothing_of_the_model(name):
    fit = FITS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for options, offset, slope in (({"offset": True}, 40.0, 0.0), ({"trend": True}, -7.0, 0.9)):
            bare = fit(record(), **options)
            moved = fit(shifted(record(), offset, slope), **options)
            assert moved.parameters == pytest.approx(bare.parameters, abs=1e-6)
            assert moved.covariance == pytest.approx(bare.covariance, rel=1e-4, abs=1e-12)
            assert moved.residuals == pytest.approx(bare.residuals, abs=1e-6)
            middle = record().time.mean()
            (found,), (before,) = moved.diagnostics["offsets"][0], bare.diagnostics["offsets"][0]
            assert found - before == pytest.approx(offset + slope * middle, abs=1e-5)
            (found,), (before,) = moved.diagnostics["slopes"][0], bare.diagnostics["slopes"][0]
            assert found - before == pytest.approx(slope, abs=1e-6)
            assert moved.operating_point[1] == pytest.approx(moved.diagnostics["offsets"][0])


def test_arx_with_a_trend_is_a_regression_on_its_terms():
    data = shifted(record(), 3.0, 0.2)
    y, u, t = data.y[:, 0], data.u[:, 0], np.arange(len(data), dtype=float)
    columns = np.column_stack([-y[1:-1], -y[:-2], u[1:-1], u[:-2], np.ones(len(t) - 2), t[2:]])
    expected, squares, _, _ = np.linalg.lstsq(columns, y[2:], rcond=None)
    model = sysid.arx(data, 2, 2, trend=True)
    assert model.parameters == pytest.approx(expected[:4], rel=1e-8)
    variance = squares[0] / (len(y) - 2 - 6)
    assert model.noise_variance[0, 0] == pytest.approx(variance, rel=1e-8)
    inverse = np.linalg.inv(columns.T @ columns)[:4, :4]
    assert model.covariance == pytest.approx(variance * inverse, rel=1e-6)


@pytest.mark.parametrize(
    ("conditions", "missing"),
    # backcasting needs complete outputs
    [("estimated", 0.0), ("estimated", 0.1), ("zero", 0.0), ("zero", 0.1), ("backcast", 0.0)],
)
def test_the_gradient_beside_a_trend_is_that_of_differences(conditions, missing):
    conditions = InitialConditions(conditions)
    experiments = [shifted(record(k, 200, missing), 3.0 * k, 0.1) for k in range(2)]
    orders = Orders(1, (2,), 1, 1, (2,), (1,), 1)
    theta = np.array([-0.1, 0.3, 0.2, 0.5, -0.6, -1.1, 0.4])
    at = linearise(experiments, orders, theta, conditions)
    for k in range(orders.count):
        step = 1e-6 * np.eye(orders.count)[k]
        rise = [linearise(experiments, orders, theta + side * step, conditions).cost for side in (1.0, -1.0)]
        assert at.gradient[k] == pytest.approx((rise[0] - rise[1]) / 4e-6, rel=1e-5, abs=1e-5)


def test_a_record_that_begins_far_from_its_level_keeps_its_gain():
    # its mean includes the transient: without an offset the gain is 6 instead of 15
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 20), 15)
    x, y = 60.0, []
    for value in u:
        y.append(x)
        x = 0.98 * x + 0.3 * value
    data = IOData(u, np.array(y) + 20.0 + 0.2 * rng.standard_normal(len(u)), 0.02).detrend()
    level = 20.0 + 15.0 * data.input_offset[0]
    for fit in (partial(sysid.oe, nb=1, nf=1), partial(sysid.bj, nb=1, nc=1, nd=1, nf=1)):
        model = fit(data, offset=True)
        assert model.dc_gain()[0, 0] == pytest.approx(15.0, rel=0.1)
        assert model.operating_point[1][0] == pytest.approx(level, abs=1.5)


def test_intervals_allow_for_the_offset():
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(200):
        u = rng.standard_normal(150) + 2.0
        y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 5.0 + 0.3 * rng.standard_normal(150)
        model = sysid.oe(IOData(u, y, 1.0), 1, 1, offset=True, coloured=False)
        deviation = np.sqrt(model.covariance[0, 0])
        covered += abs(model.parameters[0] - 0.2) < 1.96 * deviation
    # 95 % of 200, less four standard deviations of that count
    assert covered >= 178


def test_every_experiment_has_a_level_of_its_own():
    records = [shifted(record(k), level, 0.0) for k, level in enumerate((5.0, -40.0, 0.0))]
    model = sysid.oe(records, 2, 2, offset=True)
    assert model.dc_gain()[0, 0] == pytest.approx(GAIN, rel=0.05)
    levels = np.ravel(model.diagnostics["offsets"])
    assert levels == pytest.approx([5.0, -40.0, 0.0], abs=0.2)
    assert model.operating_point[1][0] == pytest.approx(levels.mean())


def test_gaps_do_not_move_the_trend():
    model = sysid.oe(shifted(record(missing=0.1), 40.0, 0.5), 2, 2, trend=True)
    assert model.dc_gain()[0, 0] == pytest.approx(GAIN, rel=0.05)
    assert model.diagnostics["slopes"][0][0] == pytest.approx(0.5, abs=0.01)


def test_backcasting_reaches_beyond_a_fast_transient():
    # the free response of 1/F ends long before the record does
    rng = np.random.default_rng(0)
    u = rng.standard_normal(3000)
    y = lfilter([0.0, 1.0, 0.2], [1.0, -0.1, 0.02], u) + lfilter([1.0, 0.5], [1.0, -0.5], rng.standard_normal(3000))
    model = sysid.bj(IOData(u, y, 0.1), 2, 1, 1, 2, initial_conditions="backcast")
    assert model.dc_gain()[0, 0] == pytest.approx(1.2 / 0.92, rel=0.1)


def test_what_is_no_option_is_refused():
    with pytest.raises(SysidError, match="offset"):
        sysid.oe(record(), 2, 2, offset=3.0)
    with pytest.raises(SysidError, match="2 terms of a trend"):
        sysid.oe(IOData(np.arange(9.0) ** 2, record().y[:9], 0.1), 2, 2, trend=True)


@pytest.mark.parametrize(("offset", "slope", "expected"), [(0.0, 0.0, -1), (4.0, 0.0, 0), (4.0, 0.3, 1)])
def test_the_degree_of_a_trend_is_found(offset, slope, expected):
    found = [best_degree([shifted(record(seed), offset, slope)]) for seed in range(10)]
    assert found == [expected] * 10


def test_too_few_samples_for_an_arx_model_need_no_trend():
    assert best_degree([record(samples=20)]) == -1

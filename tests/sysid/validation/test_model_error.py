"""Intervals for the gain of the best linear system, of models of too low an order and of nonlinear systems."""

import dataclasses
import re

import numpy as np
import pytest
from scipy.signal import chirp, lfilter

import sysid
from sysid import IOData, model_error
from tests.refusals import refused
from tests.sysid.models.test_repeated_errors import F, best_linear_gain, record

DT = 0.02
TRUE_B, TRUE_A = [0.0, 0.1, 0.05], [1.0, -1.4, 0.55]
HZ = np.array([0.5, 1.0, 2.0, 5.0])


def gain(b, a, f):
    z = np.exp(2j * np.pi * f * DT)
    return np.abs(np.polyval(b[::-1], 1 / z) / np.polyval(a[::-1], 1 / z))


def linear_record(seed, samples=3000, noise=0.1, colour=0.0):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    v = lfilter([1.0], [1.0, -colour], noise * rng.standard_normal(samples))
    return IOData(u, lfilter(TRUE_B, TRUE_A, u) + v, DT)


def holds(interval, truth):
    low, high = (end[:, 0, 0] for end in interval)
    return (low <= truth) & (truth <= high)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_where_noise_explains_the_errors_the_interval_is_that_of_the_parameters(colour):
    p_values = []
    for seed in range(60):
        data = linear_record(seed, 1500, colour=colour)
        estimate = sysid.oe(data, 2, 2, 1, coloured=True)
        error = model_error(estimate, data, HZ)
        p_values.append(error.p_values[0])
        if not error.is_wider[0]:
            for end, of_noise in zip(error.interval, error.noise_alone, strict=True):
                np.testing.assert_array_equal(end, of_noise)
    assert np.mean(np.array(p_values) < 0.05) < 0.15
    assert np.mean(np.array(p_values) < 0.01) < 0.06
    # of two tests the smaller one counts twice, and the second one hardly ever is
    assert np.mean(np.array(p_values) < 0.5) == pytest.approx(0.25, abs=0.15)


@pytest.mark.parametrize("estimator", ["oe", "arx", "armax", "okid", "n4sid"])
def test_too_low_an_order_shows_and_the_interval_holds_the_true_gain(estimator):
    fits = {
        "oe": lambda data: sysid.oe(data, 1, 1, 1),
        "arx": lambda data: sysid.arx(data, 1, 1, 1),
        "armax": lambda data: sysid.armax(data, 1, 1, 1, 1),
        "okid": lambda data: sysid.okid(data, 1, p=1),
        "n4sid": lambda data: sysid.n4sid(data, 1),
    }
    held, alone = [], []
    for seed in range(10):
        data = linear_record(seed)
        error = model_error(fits[estimator](data), data, HZ)
        assert error.is_wider.all()
        assert "the order is too low" in error.reasons[0]
        held.append(holds(error.interval, gain(TRUE_B, TRUE_A, HZ)))
        alone.append(holds(error.noise_alone, gain(TRUE_B, TRUE_A, HZ)))
    assert np.mean(held) >= 0.9
    assert np.mean(alone) < 0.6


def test_a_wrong_model_of_the_noise_shows_and_the_interval_holds_the_true_gain():
    # the orders of the path are right: another choice of the parameters would explain the errors
    resonant = [0.0, 0.4, 0.2], [1.0, -1.2, 0.5]
    held, alone = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = lfilter([1.0], [1.0, -0.6], rng.standard_normal(3000))
        data = IOData(u, lfilter(*resonant, u) + 0.3 * rng.standard_normal(3000), DT)
        error = model_error(sysid.arx(data, 2, 2, 1), data, HZ)
        assert error.is_wider.all()
        held.append(holds(error.interval, gain(*resonant, HZ)))
        alone.append(holds(error.noise_alone, gain(*resonant, HZ)))
    assert np.mean(held) >= 0.9
    assert np.mean(alone) < 0.6


def saturated_record(seed, samples=2600):
    """Noise of low pass, whose power changes slowly, through a saturation between two poles."""
    rng = np.random.default_rng([9, seed])
    u = 0.2 * lfilter([1.0], [1.0, -0.7], rng.standard_normal(samples + 200))
    x = np.clip(lfilter([0.2], [1.0, -0.8], u), -0.12, 0.12)
    y = lfilter([0.0, 0.15], [1.0, -0.85], x) + 2e-4 * rng.standard_normal(samples + 200)
    return IOData(u[200:], y[200:], DT)


def gain_of_many(records):
    """Gain of the best linear system at `HZ`, from a cubic through the lines near."""
    spectra = []
    for data in records:
        window = np.hanning(len(data))
        spectra.append([np.fft.rfft(window * signal[:, 0]) for signal in (data.u, data.y)])
    u, y = np.moveaxis(np.array(spectra), 1, 0)
    f = np.fft.rfftfreq(len(data), DT)
    cross, power = np.sum(y * u.conj(), axis=0), np.sum(np.abs(u) ** 2, axis=0)
    gains = []
    for hz in HZ:
        near = (f > hz / 1.3) & (f < hz * 1.3)
        root = np.sqrt(power[near])
        terms = np.vander(np.log(f[near] / hz), 4, increasing=True)
        gains.append(np.abs(np.linalg.lstsq(terms * root[:, None], cross[near] / root, rcond=None)[0][0]))
    return np.array(gains)


def test_a_gain_that_follows_the_power_of_the_input_shows_and_the_interval_counts_it():
    truth = gain_of_many([saturated_record(seed) for seed in range(1000, 1300)])
    held, alone, reasons = [], [], []
    for seed in range(40):
        data = saturated_record(seed).detrend()
        error = model_error(sysid.oe(data, 2, 2, 1), data, HZ)
        held.append(holds(error.interval, truth))
        alone.append(holds(error.noise_alone, truth))
        reasons.append(error.reasons[0])
    assert np.mean(held) >= 0.9
    assert np.mean(alone) < 0.85
    assert sum("the gain differs between the 8 parts" in reason for reason in reasons) > 30


def test_intervals_do_not_depend_on_units():
    data = linear_record(0)
    small = IOData(1e-4 * data.u, 1e-4 * data.y, DT)
    error, of_small = (model_error(sysid.oe(record, 1, 1, 1), record, HZ) for record in (data, small))
    for end, other in zip(error.interval, of_small.interval, strict=True):
        np.testing.assert_allclose(end, other, rtol=1e-4)


def test_distortion_that_repeats_with_the_input_shows_and_the_interval_holds_the_best_linear_gain():
    truth = best_linear_gain(F)
    held, alone = [], []
    for seed in range(40):
        data = record(seed)
        error = model_error(sysid.oe(data, 2, 2, 1), data, F)
        held.append(holds(error.interval, truth))
        alone.append(holds(error.noise_alone, truth))
    assert np.mean(held) > 0.88
    assert np.mean(alone) < 0.6
    (reason,) = error.reasons
    assert "is the same in all 15 periods" in reason
    assert "a second sequence, best a random-phase multisine" in reason
    assert "with distortion and order" in str(error)


def test_of_two_sequences_no_second_one_is_asked_for():
    data = [record(0), record(1)]
    error = model_error(sysid.oe(data, 2, 2, 1), data, F)
    assert "of 2 sequences" in error.reasons[0]
    assert "a second sequence" not in error.reasons[0]


def test_two_sequences_tell_distortion_from_too_low_an_order():
    distorted, too_low = [], []
    for seed in range(20):
        data = [record(2 * seed), record(2 * seed + 1)]
        distorted.append(model_error(sysid.oe(data, 2, 2, 1), data, F))
        too_low.append(model_error(sysid.oe(data, 1, 1, 1), data, F))
    assert sum("nonlinear distortion, as" in error.reasons[0] for error in distorted) >= 18
    assert sum("the order is too low, as" in error.reasons[0] for error in too_low) >= 18
    (single,) = model_error(sysid.oe(record(0), 2, 2, 1), record(0), F).sequences
    assert np.isnan(single.p_common)
    assert np.isnan(single.p_alike)


def test_an_input_with_few_lines_or_one_period_says_that_it_cannot_tell():
    data = linear_record(0, 90)
    error = model_error(sysid.arx(data, 1, 1, 1), data, HZ)
    assert np.isnan(error.p_values[0])
    assert np.isnan(error.interval).all()
    assert np.isfinite(error.noise_alone).all()
    assert "a longer record would have them" in error.reasons[0]
    lines, needed = error.line_counts[0]
    assert lines < needed


def test_the_bandwidth_does_not_depend_on_the_list_of_frequencies():
    data = linear_record(0)
    estimate = sysid.oe(data, 2, 2, 1)
    grid = np.concatenate(([0.0, 0.5], np.geomspace(0.51, 20.0, 80)))
    fine = model_error(estimate, data, grid)
    from_line = fine.bandwidth(0.5)
    shuffled = model_error(estimate, data, np.random.default_rng(0).permutation(grid))
    np.testing.assert_allclose(shuffled.bandwidth(0.5).hz, from_line.hz, rtol=1e-9)
    np.testing.assert_allclose(shuffled.bandwidth().hz, fine.bandwidth().hz, rtol=1e-9)
    # steps above the crossings do not matter
    wide = model_error(estimate, data, [*grid[grid < 2.0 * from_line.ci95[1].item()], 24.0])
    np.testing.assert_allclose(wide.bandwidth(0.5).hz, from_line.hz, rtol=1e-9)
    coarse = model_error(estimate, data, [0.5, 1.0, 2.0, 4.0])
    refused("steps of a fifth or less", coarse.bandwidth)
    refused("one of the 4 frequencies", coarse.bandwidth, 0.7)


def test_two_inputs_and_two_outputs():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 2))
    other = [0.0, 0.2], [1.0, -0.8]
    first = lfilter(TRUE_B, TRUE_A, u[:, 0]) + lfilter(*other, u[:, 1])
    second = lfilter(*other, u[:, 0])
    data = IOData(u, np.column_stack((first, second)) + 0.05 * rng.standard_normal((4000, 2)), DT)
    # one pole for all paths of the first output is too few
    error = model_error(sysid.n4sid(data, 1), data, HZ)
    assert error.gain.shape == (4, 2, 2)
    low, high = error.interval
    truth = np.empty((4, 2, 2))
    truth[:, 0, 0], truth[:, 0, 1] = gain(TRUE_B, TRUE_A, HZ), gain(*other, HZ)
    truth[:, 1, 0], truth[:, 1, 1] = gain(*other, HZ), 0.0
    inside = (low <= truth) & (truth <= high)
    assert inside[:, 0].all()
    assert inside[:, 1, 0].all()
    assert error.is_wider[0]
    # the parts of the record tell nothing of a path without gain, but that it is small
    assert (low[:, 1, 1] >= 0.0).all()
    assert high[:, 1, 1].max() < 100.0


def test_windows_missing_outputs_and_operating_points():
    data = linear_record(3)
    y = data.y + 7.0
    y[500:520] = np.nan
    gapped = IOData(data.u + 3.0, y, DT, missing=True, window=50)
    estimate = sysid.oe(gapped, 1, 1, 1, offset=True)
    error = model_error(estimate, gapped, HZ)
    assert holds(error.interval, gain(TRUE_B, TRUE_A, HZ)).all()


@pytest.mark.parametrize("pattern", ["at random", "a block"])
@pytest.mark.parametrize("periods", [1, 5])
def test_missing_outputs_do_not_make_errors_smaller(pattern, periods):
    held, alone = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        u = np.tile(rng.choice([-1.0, 1.0], 1500 // periods), periods)
        y = lfilter(TRUE_B, TRUE_A, u) + 0.02 * rng.standard_normal(1500)
        if pattern == "a block":
            y[400:1000] = np.nan
        else:
            y[rng.random(1500) < 0.4] = np.nan
        data = IOData(u, y, DT, missing=True)
        error = model_error(sysid.oe(data, 1, 1, 1), data, HZ)
        held.append(holds(error.interval, gain(TRUE_B, TRUE_A, HZ)))
        alone.append(holds(error.noise_alone, gain(TRUE_B, TRUE_A, HZ)))
    assert np.mean(held) >= 0.9
    assert np.mean(alone) < 0.6


def test_beside_an_input_that_repeats_another_does_not():
    held = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        u = np.column_stack((np.tile(rng.choice([-1.0, 1.0], 300), 5), rng.choice([-1.0, 1.0], 1500)))
        other = lfilter([0.0, 0.05, 0.05], [1.0, -1.2, 0.5], u[:, 0])
        y = other + lfilter(TRUE_B, TRUE_A, u[:, 1]) + 0.02 * rng.standard_normal(1500)
        data = IOData(u, y, DT)
        error = model_error(sysid.oe(data, [2, 1], [2, 1], [1, 1]), data, HZ)
        assert error.is_wider.all()
        low, high = (end[:, 0, 1] for end in error.interval)
        held.append((low <= gain(TRUE_B, TRUE_A, HZ)) & (gain(TRUE_B, TRUE_A, HZ) <= high))
    assert np.mean(held) >= 0.9


def test_errors_that_are_small_at_every_line_show_in_bands():
    shown, held = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = np.tile(rng.choice([-1.0, 1.0], 300), 5)
        data = IOData(u, lfilter(TRUE_B, TRUE_A, u) + rng.standard_normal(1500), DT)
        error = model_error(sysid.oe(data, 1, 1, 1), data, HZ)
        shown.append(error.is_wider[0])
        held.append(holds(error.interval, gain(TRUE_B, TRUE_A, HZ)))
    assert np.mean(shown) > 0.7
    assert np.mean(held) >= 0.85


def test_two_sequences_of_a_linear_system_with_noise_show_no_distortion():
    reasons = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        data = []
        for _ in range(2):
            u = np.tile(rng.choice([-1.0, 1.0], 300), 4)
            data.append(IOData(u, lfilter(TRUE_B, TRUE_A, u) + 0.5 * rng.standard_normal(1200), DT))
        reasons += model_error(sysid.oe(data, 1, 1, 1), data, HZ).reasons
    assert sum("nonlinear distortion, as" in reason for reason in reasons) <= 1
    assert sum("the order is too low" in reason for reason in reasons) > 20


def test_feedback_is_told_where_noise_may_make_the_errors():
    explained = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        reference = np.repeat(rng.choice([-1.0, 1.0], 500), 3)
        v = lfilter([1.0], [1.0, -0.9], 0.1 * rng.standard_normal(1500))
        u, x = np.zeros((2, 1500))
        for t in range(2, 1500):
            x[t] = 0.1 * u[t - 1] + 0.05 * u[t - 2] + 1.4 * x[t - 1] - 0.55 * x[t - 2]
            u[t] = 1.5 * (reference[t] - x[t] - v[t])
        data = IOData(u, x + v, DT)
        error = model_error(sysid.oe(data, 2, 2, 1), data, HZ)
        if not error.is_wider[0]:
            explained += 1
            assert "the input depends on past outputs" in error.reasons[0]
    assert explained > 2
    openly = linear_record(0)
    assert "depends on past outputs" not in model_error(sysid.oe(openly, 2, 2, 1), openly, HZ).reasons[0]


def test_sines_tell_no_distortion_from_order():
    t = np.arange(3000) * DT
    u = np.sin(2.0 * np.pi * t) + np.sin(4.0 * np.pi * t)
    y = lfilter(TRUE_B, TRUE_A, u + 0.3 * u**3)[1000:] + 1e-3 * np.random.default_rng(0).standard_normal(2000)
    data = IOData(u[1000:], y, DT)
    error = model_error(sysid.oe(data, 2, 2, 1), data, [1.0, 2.0])
    assert error.is_wider[0]
    assert np.isnan(error.interval[0]).all()
    assert "cannot be told from each other" in error.reasons[0]


def test_refusals():
    data = linear_record(0)
    estimate = sysid.oe(data, 2, 2, 1)
    refused("expected an Estimate", model_error, estimate.model, data, [1.0])
    refused("Nyquist", model_error, estimate, data, [30.0])
    refused("frequencies", model_error, estimate, data, [])
    refused("0 Hz to Nyquist", model_error, estimate, data, [-1.0])
    with pytest.warns(sysid.SysidWarning, match="none that the model was estimated from"):
        model_error(estimate, linear_record(1), [1.0])
    unstable = sysid.arx(IOData(data.u, np.cumsum(np.cumsum(data.y)) * np.geomspace(1, 1e3, 3000), DT), 2, 1, 1)
    if not unstable.model.is_stable():
        refused("stable", model_error, unstable, data, [1.0])


def test_noise_in_the_measured_input_is_told_with_what_it_may_take_from_the_gain():
    rng = np.random.default_rng(0)
    u = np.tile(np.repeat(np.sign(rng.standard_normal(100)), 5), 6)
    y = lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.02 * rng.standard_normal(len(u))
    told = []
    for deviation in (0.0, 0.3):
        data = IOData(u + deviation * rng.standard_normal(len(u)), y, 0.02)
        (reason,) = model_error(sysid.oe(data, 1, 1, 1), data, [1.0]).reasons
        told.append(reason)
    assert "differs from period to period" not in told[0]
    # about 0.09 of 1.09: white noise of 0.3 beside a binary input of one
    assert re.search(r"; [78]\.\d % of the input's power differs from period to period", told[1])


@pytest.mark.parametrize("reference", [[0.3, 0.4], "a", float("nan"), -1.0])
def test_a_reference_that_is_no_frequency_is_refused(reference):
    data = linear_record(0, 500)
    error = model_error(sysid.oe(data, 1, 1, 1), data, np.geomspace(0.1, 10.0, 60))
    refused("reference must be at least 0", error.bandwidth, reference)


@pytest.mark.parametrize(("shift", "least"), [(20, 5.0), (100, 1.0), (-100, 1.0), (None, 0.0)])
def test_paths_of_an_input_and_its_copy_are_not_told_apart(shift, least):
    """A copy 0.4 s later: with too low an order the intervals at 1 Hz held the gain in 42 % of 60 records."""
    rng = np.random.default_rng(4)
    sequence = np.repeat(np.sign(rng.standard_normal(100)), 5)
    other = np.sign(rng.standard_normal(500)) if shift is None else np.roll(sequence, shift)
    u = np.tile(np.column_stack((sequence, other)), (6, 1))
    y = lfilter([0.0, 0.0, 0.02], np.convolve([1.0, -0.9], [1.0, -0.8]), u[:, 0]) + lfilter(
        [0.0, 0.02], [1, -0.95], u[:, 1]
    )
    data = IOData(u, y + 0.02 * rng.standard_normal(len(u)), DT)
    error = model_error(sysid.oe(data, [1, 1], [1, 1], [1, 1]), data, [0.5, 2.0, 6.0])
    assert error.least_told == pytest.approx(least)
    np.testing.assert_array_equal(np.isnan(error.interval[0][:, 0, 0]), error.frequencies < least)
    assert ("does not tell which path" in error.reasons[0]) == (shift is not None)


def swept(seed, kind):
    """Period of 200 samples with the lines of a sweep, or with random phases."""
    rng = np.random.default_rng(seed)
    t = np.arange(200) * DT
    if kind == "random phases":
        return np.cos(2.0 * np.pi * (np.outer(t, np.arange(2, 40)) / 4.0 + rng.random(38))).sum(axis=1)
    if kind == "binary":
        return np.repeat(rng.choice([-1.0, 1.0], 100), 2)
    first, last = (10.0, 0.5) if kind == "falling" else (0.5, 10.0)
    method = "logarithmic" if kind == "logarithmic" else "linear"
    return chirp(t, first, 4.0, last, method=method, phi=360.0 * rng.random())


@pytest.mark.parametrize("kind", ["rising", "falling", "logarithmic", "random phases", "binary"])
def test_what_a_sweep_hides_is_told(kind):
    for seed in range(5):
        u = np.tile(swept(seed, kind), 11)
        x = lfilter(TRUE_B, TRUE_A, u)
        y = lfilter(TRUE_B, TRUE_A, x + 0.3 * x**3)[200:]
        data = IOData(u[200:], y + 1e-3 * np.random.default_rng(seed).standard_normal(2000), DT)
        (reason,) = model_error(sysid.arx(data, 2, 2, 1), data, HZ).reasons
        assert ("the input sweeps over its frequencies" in reason) == (kind in ("rising", "falling", "logarithmic"))


@pytest.mark.parametrize("order", [1, 2])
def test_without_a_covariance_parameters_count_as_uncertain_as_those_of_an_efficient_estimator(order):
    held, widths = [], []
    for seed in range(20):
        data = linear_record(seed)
        by_n4sid = model_error(sysid.n4sid(data, order), data, HZ)
        assert "the estimator gives no covariance" in by_n4sid.reasons[0]
        assert np.isnan(by_n4sid.noise_alone).all()
        efficient = model_error(sysid.pem_ss(data, order), data, HZ)
        assert "covariance" not in efficient.reasons[0]
        held.append(holds(by_n4sid.interval, gain(TRUE_B, TRUE_A, HZ)))
        widths.append(np.subtract(*by_n4sid.interval) / np.subtract(*efficient.interval))
    assert np.mean(held) >= 0.9
    # of the right order the two are nearly the same model
    if order == 2:
        assert np.median(widths) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("order", [1, 2])
def test_without_a_covariance_and_its_bound_no_interval_is_given(order):
    """The lines alone would say that the error of the parameters is none, whether noise explains the errors or not."""
    data = linear_record(0)
    fit = sysid.n4sid(data, order)
    no_noise = dataclasses.replace(fit, noise_variance=np.full_like(fit.noise_variance, np.nan))
    result = model_error(no_noise, data, HZ)
    assert np.isnan(result.interval).all()
    assert "no interval is given" in result.reasons[0]
    assert "efficient" not in result.reasons[0]


def test_an_operating_point_does_not_matter_without_a_covariance():
    data = linear_record(0)
    moved = IOData(data.u + 3.0, data.y - 7.0, DT)
    one = model_error(sysid.n4sid(data.detrend(), 2), data.detrend(), HZ)
    other = model_error(sysid.n4sid(moved.detrend(), 2), moved, HZ)
    np.testing.assert_allclose(one.interval, other.interval, rtol=1e-6)

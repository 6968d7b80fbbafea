import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidWarning, lpm
from tests.refusals import refused

DT = 0.02
B, A = [0.0, 0.1, 0.05], [1.0, -1.4, 0.55]
HZ = np.array([0.3, 1.0, 3.0, 8.0])


def response(f, b=B, a=A):
    z = np.exp(2j * np.pi * f * DT)
    return np.polyval(b[::-1], 1 / z) / np.polyval(a[::-1], 1 / z)


def resonance(frequency, radius):
    angle = 2.0 * np.pi * frequency * DT
    return [0.0, 1e-3, 1e-3], [1.0, -2.0 * radius * np.cos(angle), radius**2]


def record(seed, samples=1000, noise=0.1, b=B, a=A):
    """A record that begins in motion."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples + 300)
    y = lfilter(b, a, u) + lfilter([1.0], [1.0, -0.7], noise * rng.standard_normal(len(u)))
    return IOData(u[300:], y[300:], DT)


def test_polynomials_are_free_of_leakage_where_etfe_is_not():
    data = record(0, 3000, noise=0.0)
    smooth = np.abs(lpm(data, HZ).response[:, 0, 0] / response(HZ) - 1.0)
    raw = sysid.etfe(data)
    of_lines = np.abs(raw.response[:, 0, 0] / response(raw.frequencies) - 1.0)
    assert smooth.max() < 1e-4
    assert np.median(of_lines[raw.frequencies < 10.0]) > 1e-3


def test_rational_form_sees_an_undamped_resonance():
    b, a = resonance(2.0, 1.0)
    data = record(1, 4000, noise=0.0, b=b, a=a)
    f = np.array([0.5, 1.9, 1.99, 2.01, 2.5, 10.0])
    rational = np.abs(lpm(data, f, denominator=2).response[:, 0, 0] / response(f, b, a) - 1.0)
    polynomial = np.abs(lpm(data, f).response[:, 0, 0] / response(f, b, a) - 1.0)
    assert rational.max() < 1e-4
    # half a line off the resonance a polynomial is no model
    assert polynomial.max() > 0.3
    raw = sysid.etfe(data)
    assert np.abs(raw.response[:, 0, 0] / response(raw.frequencies, b, a) - 1.0).max() > 10.0


@pytest.mark.parametrize("options", [{}, {"degree": 3}, {"half_width": 10}, {"denominator": 1, "half_width": 8}])
def test_intervals_hold_the_truth(options):
    held, squares = [], []
    for seed in range(150):
        estimate = lpm(record(seed), HZ, **options)
        low, high = (end[:, 0, 0] for end in estimate.magnitude_ci95())
        held.append((low <= np.abs(response(HZ))) & (np.abs(response(HZ)) <= high))
        deviation = np.sqrt(np.trace(estimate.covariance[:, 0, 0], axis1=1, axis2=2))
        squares.append((np.abs(estimate.response[:, 0, 0] - response(HZ)) / deviation) ** 2)
    assert 0.92 < np.mean(held) < 0.98
    # the variance of a few lines scatters: Student's distribution has wider tails
    assert 0.9 < np.median(squares) / 0.69 < 1.4


def test_noise_spectrum_is_that_of_the_disturbance():
    f = np.linspace(1.0, 20.0, 40)
    estimates = [lpm(record(seed, 2000), f).noise_spectrum[:, 0, 0].real for seed in range(20)]
    truth = 0.01 * DT * np.abs(response(f, [1.0], [1.0, -0.7])) ** 2
    np.testing.assert_allclose(np.mean(estimates, axis=0) / truth, 1.0, atol=0.35)
    assert np.mean(estimates / truth) == pytest.approx(1.0, abs=0.05)


def test_experiments_share_the_response_and_have_transients_of_their_own():
    parts = [record(2, 500), record(3, 900), record(4, 700)]
    together, alone = lpm(parts, HZ, half_width=8), lpm(parts[0], HZ, half_width=8)
    deviations = [estimate.magnitude_deviation()[:, 0, 0] for estimate in (together, alone)]
    assert (deviations[0] < 0.9 * deviations[1]).all()
    exact = lpm([record(2, 500, 0.0), record(3, 900, 0.0)], HZ)
    np.testing.assert_allclose(exact.response[:, 0, 0], response(HZ), rtol=5e-4)


def test_several_inputs_and_outputs():
    rng = np.random.default_rng(5)
    u = rng.standard_normal((3000, 2))
    first = lfilter(B, A, u[:, 0]) + lfilter([0.0, 0.2], [1.0, -0.8], u[:, 1])
    y = np.column_stack((first, lfilter([0.0, 0.2], [1.0, -0.8], u[:, 0])))[500:]
    estimate = lpm(IOData(u[500:], y, DT), HZ)
    truth = np.zeros((4, 2, 2), dtype=complex)
    truth[:, 0, 0] = response(HZ)
    truth[:, 0, 1] = truth[:, 1, 0] = response(HZ, [0.0, 0.2], [1.0, -0.8])
    np.testing.assert_allclose(estimate.response, truth, atol=1e-4)


def test_period_averages_and_counts_distortion_as_noise():
    rng = np.random.default_rng(6)
    u = np.tile(rng.standard_normal(400), 9)
    y = lfilter(B, A, u + 0.1 * u**3) + 0.01 * rng.standard_normal(len(u))
    data = IOData(u, y, DT, window=400)
    estimate = lpm(data, HZ, period=400)
    # the cube of white normal noise is three times its variance, linearly
    low, high = (end[:, 0, 0] for end in estimate.magnitude_ci95())
    truth = 1.3 * np.abs(response(HZ))
    assert ((low <= truth) & (truth <= high)).all()
    # far more than the noise of eight periods makes
    assert (estimate.magnitude_deviation()[:, 0, 0] / truth > 0.02).all()
    # the period is found from the input
    np.testing.assert_array_equal(lpm(data, HZ).response, estimate.response)
    np.testing.assert_array_equal(lpm(data, HZ).covariance, estimate.covariance)
    with pytest.warns(sysid.SysidWarning, match="do not repeat after 300 samples"):
        lpm(data, HZ, period=300)
    assert not np.array_equal(lpm(data, HZ, period=0).response, estimate.response, equal_nan=True)


def test_frequencies_of_long_and_short_records():
    assert len(lpm(record(7, 400)).frequencies) == 199
    assert len(lpm(record(7, 5000)).frequencies) <= 400


def test_response_is_unknown_where_the_input_has_no_power():
    t = np.arange(2000) * DT
    u = np.sin(2.0 * np.pi * 5.0 * t)
    data = IOData(np.column_stack((u, u)), lfilter(B, A, u), DT)
    with pytest.warns(sysid.SysidWarning, match="do not determine the response"):
        estimate = lpm(data, [5.0])
    assert np.isnan(estimate.response).all()
    assert np.isnan(estimate.covariance).all()


def test_refusals():
    data = record(8, 200)
    refused("half_width = 2 gives 5 equations for 6 unknowns", lpm, data, half_width=2)
    refused("takes 201 lines, the shortest experiment has 99", lpm, data, half_width=100)
    refused("degree must be", lpm, data, degree=-1)
    refused("denominator must be", lpm, data, denominator=1.5)
    refused("fewer than a period of 300", lpm, data, period=300)
    refused("Nyquist", lpm, data, [30.0])
    refused("constant", lpm, IOData(np.ones(100), np.ones(100), DT))


def test_a_resonance_between_coarse_lines_is_warned_of():
    b, a = resonance(3.0, 0.99)
    rng = np.random.default_rng(0)
    u = np.tile(rng.standard_normal(500), 7)
    y = lfilter(b, a, u)
    y = y + 0.02 * np.std(y) * rng.standard_normal(len(u))
    data = IOData(u[500:], y[500:], DT)
    with pytest.warns(sysid.SysidWarning, match="the response changes faster .* denominator=2 follows it"):
        polynomials = lpm(data, [3.0])
    rational = lpm(data, [3.0], denominator=2)
    truth = response(3.0, b, a)
    assert abs(polynomials.response.item() / truth - 1.0) > 0.2
    assert abs(rational.response.item() / truth - 1.0) < 0.1


def test_noise_and_smooth_responses_are_not_warned_of(recwarn):
    for seed in range(20):
        lpm(record(seed, 3000, noise=0.5), HZ)
    assert not recwarn.list


def test_intervals_hold_beside_zero_frequency_where_the_lines_of_a_period_are_far_apart():
    """The window about 0.5 Hz reaches past 0 Hz: over lines on one side alone polynomials are 5 % off, and too sure."""
    f, dt = 0.5, 0.02
    numerator, denominator = [0.0, 0.0, 0.02], np.convolve([1.0, -0.9], [1.0, -0.8])
    z = np.exp(-2j * np.pi * f * dt)
    truth = abs(np.polyval(numerator[::-1], z) / np.polyval(denominator[::-1], z))
    held = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        u = np.tile(np.repeat(np.sign(rng.standard_normal(100)), 5), 6)
        y = lfilter(numerator, denominator, u) + 0.2 * rng.standard_normal(len(u))
        with warnings.catch_warnings():
            # it says that polynomials do not follow so closely
            warnings.simplefilter("ignore", SysidWarning)
            low, high = lpm(IOData(u, y, dt), [f]).magnitude_ci95()
        held += bool(low.item() <= truth <= high.item())
    # of 95 % intervals fewer than 34 hold with a probability of 0.01
    assert held >= 34


def test_a_silent_band_is_not_determined():
    n, dt = 500, 0.02
    rng = np.random.default_rng(0)
    phases = rng.uniform(0.0, 2.0 * np.pi, 100)
    lines = np.arange(1, 101)
    u = np.cos(2.0 * np.pi * np.outer(np.arange(n), lines) / n + phases).sum(axis=1)
    u = np.tile(u, 6)
    data = IOData(u, lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.02 * rng.standard_normal(6 * n), dt)
    for period in (None, 0):
        response = lpm(data, [5.0, 9.0, 12.0, 15.0, 20.0], period=period).response[:, 0, 0]
        np.testing.assert_array_equal(np.isnan(response), [False, False, True, True, True])


def test_a_line_and_its_image_have_one_noise():
    """Counted as two, half of the window about the third line, intervals held the truth in 87 % of 150 records."""
    f, dt = 0.1, 0.02
    truth = 0.1 / abs(np.exp(2j * np.pi * f * dt) - 0.9)
    held = 0
    for seed in range(100):
        u, e = np.random.default_rng(seed).standard_normal((2, 1500))
        low, high = lpm(IOData(u, lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.1 * e, dt), [f]).magnitude_ci95()
        held += bool(low.item() <= truth <= high.item())
    # of 95 % intervals fewer than 88 hold with a probability of 0.002
    assert held >= 88


def test_intervals_of_the_noise_spectrum_hold():
    """The spectrum is that of the sum of squares over its degrees of freedom: counted again, 92 % of 2,000 held."""
    held = 0
    for seed in range(300):
        u, e = np.random.default_rng(seed).standard_normal((2, 400))
        low, high = lpm(IOData(u, lfilter([0.0, 1.0], [1.0, -0.2], u) + e, 1.0), [0.2]).noise_ci95()
        held += bool(low.item() <= 1.0 <= high.item())
    # of 95 % intervals fewer than 276 hold with a probability of 0.008
    assert held >= 276

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import FrequencyResponse, IOData, merge, spa, spafdr
from tests.refusals import refused

F = np.array([0.0, 1.0, 2.0, 5.0])
G = 1.0 / (1.0 + 1j * F)


def record(seed, samples=4000, inputs=1, noise=0.3):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, inputs)) @ np.triu(np.ones((inputs, inputs)))
    clean = lfilter([0, 1.0], [1, -0.7], u, axis=0).sum(axis=1)
    return IOData(u, clean + noise * lfilter([1.0], [1, 0.5], rng.standard_normal(samples)), 0.1)


def truth(f):
    z = np.exp(0.2j * np.pi * np.asarray(f))
    return 1.0 / (z - 0.7)


def test_own_response_keeps_what_is_stated():
    one = FrequencyResponse.from_data(F, G, dt=0.1, coherence=np.full(4, 0.8), averages=5)
    assert one.response.shape == (4, 1, 1) and one.degrees_of_freedom == 8.0
    variance = np.abs(G) ** 2 * 0.2 / (0.8 * 4)
    np.testing.assert_allclose(np.trace(one.covariance[1:3, 0, 0], axis1=1, axis2=2), variance[1:3])
    assert one.covariance[0, 0, 0, 1, 1] == one.covariance[3, 0, 0, 1, 1] == 0.0  # real at 0 Hz and Nyquist
    assert FrequencyResponse.from_data(F, G).covariance is None and FrequencyResponse.from_data(F, G).dt == 0.0
    joint = np.broadcast_to([[2.0, 1j], [-1j, 1.0]], (4, 2, 2))
    two = FrequencyResponse.from_data(
        F[1:], np.stack([G, G], 1)[1:, :, None], covariance=joint[1:], output_names=["a", "b"]
    )
    # Cov(Re a, Im b) = -Im(E a b*) / 2
    expected = [[1.0, 0, 0, -0.5], [0, 1.0, 0.5, 0], [0, 0.5, 0.5, 0], [-0.5, 0, 0, 0.5]]
    np.testing.assert_allclose(two.full_covariance()[0], expected, atol=1e-12)
    part = two.select(slice(1, None), outputs=["b"])
    np.testing.assert_allclose(part.full_covariance(), np.tile(0.5 * np.eye(2), (2, 1, 1)), atol=1e-12)
    assert part.output_names == ("b",)


def test_own_response_is_checked():
    make = FrequencyResponse.from_data
    refused("ascending", make, F[::-1], G)
    refused("up to Nyquist", make, F, G, dt=0.2)
    refused("NaN", make, F, G * np.nan)
    refused("got \\(3,\\) and", make, F[:3], G)
    refused("one of variance", make, F, G, variance=F, coherence=F)
    refused("averages", make, F, G, coherence=np.full(4, 0.5))
    refused("above 0 and up to 1", make, F, G, coherence=F, averages=3)
    refused("negative", make, F, G, variance=F - 1.0)
    refused("variance: expected shape", make, F, G, variance=F[:2])
    refused("Hermitian", make, F, G, covariance=np.ones((4, 2, 2)))
    refused("mask of 4", make(F, G).select, np.ones(3, bool))
    refused("no input", make(F, G).select, inputs=["x"])


def test_select_is_what_the_estimator_would_have_given():
    data = record(0, inputs=2)
    whole, part = spa(data), spa(data, frequencies=spa(data).frequencies[10:20])
    taken = whole.select(slice(10, 20), inputs=[1])
    np.testing.assert_allclose(taken.response, part.response[:, :, [1]])
    np.testing.assert_allclose(taken.covariance, part.covariance[:, :, [1]])
    assert taken.input_spectrum.shape == (10, 1, 1) and taken.degrees_of_freedom == whole.degrees_of_freedom


@pytest.mark.thorough
def test_covariance_of_all_entries_is_that_of_many_records():
    # where the response varies little within the window, so that its variance has no part from smoothing
    f = np.array([3.0, 4.0])
    draws = [spa(record(seed, 2000, 2), lag=50, frequencies=f) for seed in range(300)]
    errors = np.array([np.stack((d.response.real, d.response.imag), -1).reshape(2, -1) for d in draws])
    stated = np.mean([d.full_covariance() for d in draws], axis=0)
    for k in range(2):
        measured = np.cov(errors[:, k].T)
        size = np.sqrt(np.outer(np.diag(stated[k]), np.diag(stated[k])))
        np.testing.assert_allclose(measured / size, stated[k] / size, atol=0.25)
        assert abs(stated[k] / size)[0, 2] > 0.5  # dependent inputs


def test_merged_responses_are_weighted_by_their_covariances():
    a = FrequencyResponse.from_data(F, G, variance=np.full(4, 1.0))
    b = FrequencyResponse.from_data(F, G + 3.0, variance=np.full(4, 2.0))
    both = merge([a, b])
    np.testing.assert_allclose(both.response, a.response + 1.0)
    np.testing.assert_allclose(both.covariance[1:], np.tile(np.eye(2) / 3.0, (3, 1, 1, 1, 1)), atol=1e-12)
    data = record(1, inputs=2)
    one = spa(data)
    twice = merge([one, one])
    np.testing.assert_allclose(twice.response, one.response, rtol=1e-9)
    np.testing.assert_allclose(twice.full_covariance(), one.full_covariance() / 2.0, atol=1e-9 * one.covariance.max())
    assert twice.degrees_of_freedom == 2.0 * one.degrees_of_freedom
    refused("other frequencies", merge, [a, b.select([0, 1])])
    refused("list of FrequencyResponse", merge, a)
    refused("gives no covariance", merge, [a, FrequencyResponse.from_data(F, G)])


def test_spafdr_is_exact_without_noise_and_its_resolution_a_constant_one_of_spa():
    data = record(2, 6000, noise=0.0)
    f = np.geomspace(0.2, 4.5, 20)
    np.testing.assert_allclose(spafdr(data, 0.05, f).response[:, 0, 0], truth(f), rtol=0.02)
    noisy = record(3, 6000)
    wide, narrow = spafdr(noisy, 0.4, f), spafdr(noisy, 0.1, f)
    ratio = narrow.covariance[:, 0, 0, 0, 0] / wide.covariance[:, 0, 0, 0, 0]
    # at low frequencies the response varies within the wider window
    assert 3.0 < np.median(ratio[-10:]) < 5.0
    np.testing.assert_allclose(wide.resolution, 0.4, rtol=0.3)
    # two experiments of one record, cut: the same spectra within their scatter
    parts = spafdr([noisy[:2000], noisy[2000:]], 0.4, f)
    np.testing.assert_allclose(parts.response, wide.response, atol=4 * np.sqrt(2 * wide.covariance[..., 0, 0].max()))


@pytest.mark.thorough
def test_intervals_of_spafdr_cover_the_truth():
    f = np.array([0.5, 1.0, 2.0, 4.0])
    within = []
    for seed in range(300):
        estimate = spafdr(record(seed, 2000), None, f)
        deviation = np.sqrt(estimate.covariance[:, 0, 0, 0, 0])
        within.append(np.abs(estimate.response[:, 0, 0].real - truth(f).real) < estimate.quantile_95 * deviation)
    assert 0.92 < np.mean(within) < 0.98


def test_spafdr_refuses():
    data = record(0, 500)
    refused("above 0", spafdr, data, 0.1, [0.0, 1.0])
    refused("use a wider resolution", spafdr, data, 1e-4, [1.0])
    refused("resolution: expected", spafdr, data, [0.1, 0.2], [1.0, 2.0, 3.0])

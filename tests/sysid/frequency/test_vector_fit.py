import numpy as np
import pytest

from sysid import FrequencyResponse, damp, vector_fit
from tests.refusals import refused

# The 18th-order example of vector fitting [Gustavsen1999] without its term that grows with s, rad/s
REAL = {-4500.0: -3000.0, -41000.0: -83000.0}
PAIRS = {
    -100 + 5e3j: -5 + 7e3j,
    -120 + 15e3j: -20 + 18e3j,
    -3e3 + 35e3j: 6e3 + 45e3j,
    -200 + 45e3j: 40 + 60e3j,
    -1500 + 45e3j: 90 + 10e3j,
    -500 + 70e3j: 5e4 + 80e3j,
    -1e3 + 73e3j: 1e3 + 45e3j,
    -2e3 + 90e3j: -5e3 + 92e3j,
}


def published(f):
    s = 2j * np.pi * f
    out = 0.2 + sum(r / (s - p) for p, r in REAL.items())
    return out + sum(r / (s - p) + np.conj(r) / (s - np.conj(p)) for p, r in PAIRS.items())


def test_published_example_of_order_18_is_recovered():
    f = np.linspace(1.0, 1e5, 400)
    fit = vector_fit(FrequencyResponse.from_data(f, published(f)), 18)
    np.testing.assert_allclose(fit.frequency_response(f)[:, 0, 0], published(f), rtol=1e-8)
    expected = np.sort_complex([*REAL, *PAIRS])
    np.testing.assert_allclose(np.sort_complex(fit.poles), expected, rtol=1e-6)
    np.testing.assert_allclose(fit.direct, 0.2, rtol=1e-6)


def test_resonances_over_five_decades_are_recovered():
    poles = np.array([w * (-0.01 + 1j) for w in 2 * np.pi * np.array([0.02, 0.7, 30.0, 900.0])])
    f = np.geomspace(1e-2, 1e3, 500)
    s = 2j * np.pi * f[:, None]
    g = np.sum(np.abs(poles) * (0.5 / (s - poles) + 0.5 / (s - poles.conj())), axis=1)
    fit = vector_fit(FrequencyResponse.from_data(f, g, variance=np.abs(g) ** 2), 8, direct=False)
    np.testing.assert_allclose(fit.to_control()(s[:, 0]), g, rtol=1e-8)
    np.testing.assert_allclose(damp(fit.to_state_space(1e-4)).damping.value, 0.01 / np.hypot(1.0, 0.01), rtol=1e-4)
    refused("dt", fit.to_state_space)
    np.testing.assert_allclose(fit.poles[np.argsort(np.abs(fit.poles))], poles, rtol=1e-8)
    np.testing.assert_allclose(fit.frequency_response(f)[:, 0, 0], g, rtol=1e-8)


@pytest.mark.parametrize("stable", [True, False])
def test_entries_share_poles_in_discrete_time_and_stability_is_a_choice(stable):
    f, outside = np.linspace(0.1, 5.0, 60), 0.9 + 0.6j
    z = np.exp(0.2j * np.pi * f)
    pole = 0.6 + 0.5j if stable else outside
    residues = np.array([[1.0 + 1j, 0.3j], [2.0, -1.0 + 0.2j], [0.1, 1j]])
    g = np.array([residues / (x - pole) + residues.conj() / (x - np.conj(pole)) + 0.5 / (x + 0.3) for x in z])
    fit = vector_fit(FrequencyResponse.from_data(f, g, dt=0.1), 3, stable=stable)
    np.testing.assert_allclose(np.sort_complex(fit.poles), [-0.3, pole], rtol=1e-8)
    np.testing.assert_allclose(fit.frequency_response(f), g, rtol=1e-8)
    for response in (fit.to_state_space().frequency_response(f), np.moveaxis(fit.to_control()(z), -1, 0)):
        np.testing.assert_allclose(response, g, rtol=1e-7)
    refused("sampled every 0.1 s", fit.to_state_space, 0.2)


def test_reflects_unstable_poles_and_refuses_too_high_orders():
    f = np.linspace(0.1, 5.0, 60)
    g = FrequencyResponse.from_data(f, 1.0 / (np.exp(0.2j * np.pi * f) - 1.2), dt=0.1)
    assert np.abs(vector_fit(g, 1).poles).max() < 1.0 < np.abs(vector_fit(g, 1, stable=False).poles).max()
    refused("more unknowns", vector_fit, g.select(slice(0, 3)), 4)
    refused("order must be", vector_fit, g, 0)

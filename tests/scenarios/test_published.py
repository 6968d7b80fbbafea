"""The printed digits imply the poles, gains and bandwidths of the table in the study's notes."""

import numpy as np
import pytest

from scenarios.published import PUBLISHED, hybrid_model, okid_model, published, sysid_model

# Poles, DC gain, -3 dB frequency relative to DC (Hz), as computed independently from the printed matrices.
TABLE = {
    "ARMAX (4.7)": ([0.980, 0.781, 0.529 + 0.490j, 0.529 - 0.490j, -0.277], 1.18, 0.16),
    "OE (4.8)": ([0.943, -0.193, 0.0], 1.58, 0.47),
    "OKID (5.8)": ([0.984, 0.570], 1.15, 0.13),
    "OE (4.10)": ([0.888, 0.089], 1.09, 0.94),
    "OKID (5.9)": ([0.832, 0.417], 0.97, 1.40),
    "ARMAX (4.12)": ([0.844, 0.644, 0.0], 0.99, 1.20),
    "OKID (5.10)": ([0.890, 0.575], 0.99, 0.89),
}


@pytest.mark.parametrize("label", TABLE)
def test_poles_gain_and_bandwidth(label: str) -> None:
    (entry,) = (entry for entry in PUBLISHED if entry.label == label)
    poles, gain, bandwidth = TABLE[label]
    np.testing.assert_allclose(np.sort_complex(entry.model.poles()), np.sort_complex(poles), atol=6e-4)
    assert entry.model.dc_gain()[0, 0] == pytest.approx(gain, abs=0.006)
    assert entry.bandwidth_hz == pytest.approx(bandwidth, abs=0.006)


def test_the_state_space_digits_of_the_yaw_armax_give_another_gain() -> None:
    (entry,) = (entry for entry in PUBLISHED if entry.label == "ARMAX (4.9)")
    assert entry.model.dc_gain()[0, 0] == pytest.approx(1.31, abs=0.006)


@pytest.mark.parametrize(
    ("label", "c"), [("ARMAX (4.9)", [-0.395, -0.066, 0.307, 0, 0]), ("ARMAX (4.12)", [-0.018, 0.270, 0.0])]
)
def test_noise_polynomial_follows_from_the_gain(label: str, c: list[float]) -> None:
    (entry,) = (entry for entry in PUBLISHED if entry.label == label)
    np.testing.assert_allclose(entry.model.gain[:, 0] - entry.model.A[:, 0], c, atol=5e-4)


def test_delays_are_those_of_the_text() -> None:
    first = {entry.label: np.flatnonzero(entry.model.markov(5)[:, 0, 0])[0] for entry in PUBLISHED}
    assert first["ARMAX (4.7)"] == first["OE (4.8)"] == first["ARMAX (4.12)"] == 2
    assert first["OE (4.10)"] == 1


def test_every_model_is_stable() -> None:
    assert all(entry.model.is_stable() for entry in PUBLISHED)


def test_three_joint_models_are_block_diagonal() -> None:
    assert (sysid_model().order, okid_model().order, hybrid_model().order) == (10, 6, 9)
    response = sysid_model().frequency_response(1.0)[0]
    assert np.all(response[~np.eye(3, dtype=bool)] == 0.0)
    assert response[1, 1] == published("shoulder_pitch")[0].model.frequency_response(1.0)[0, 0, 0]
    assert hybrid_model().frequency_response(1.0)[0, 2, 2] == okid_model().frequency_response(1.0)[0, 2, 2]

"""The printed digits imply the poles, gains and bandwidths of the table in the study's notes."""

import numpy as np
import pytest

from scenarios.truth.published import BY_NAME, EQUATIONS, PUBLISHED, published, published_model
from tests.refusals import refused

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
def test_poles_gain_and_bandwidth(label):
    (entry,) = (entry for entry in PUBLISHED if entry.label == label)
    assert entry.model.is_stable()
    poles, gain, bandwidth = TABLE[label]
    np.testing.assert_allclose(np.sort_complex(entry.model.poles()), np.sort_complex(poles), atol=6e-4)
    assert entry.model.dc_gain()[0, 0] == pytest.approx(gain, abs=0.006)
    assert entry.bandwidth_hz == pytest.approx(bandwidth, abs=0.006)


@pytest.mark.parametrize(("name", "c"), [("4.9", [-0.395, -0.066, 0.307, 0, 0]), ("4.12", [-0.018, 0.270, 0.0])])
def test_noise_polynomial_follows_from_the_gain(name, c):
    entry = EQUATIONS[name]
    np.testing.assert_allclose(entry.model.gain[:, 0] - entry.model.A[:, 0], c, atol=5e-4)


def test_delays_are_those_of_the_text():
    first = {
        name: np.flatnonzero(EQUATIONS[name].model.markov(5)[:, 0, 0])[0] for name in ("4.7", "4.8", "4.12", "4.10")
    }
    assert first == {"4.7": 2, "4.8": 2, "4.12": 2, "4.10": 1}


def test_three_joint_models_are_block_diagonal():
    own, okid, hybrid = (published_model(name).model for name in ("sysid", "okid", "hybrid"))
    assert (own.order, okid.order, hybrid.order) == (10, 6, 9)
    response = own.frequency_response(1.0)[0]
    assert np.all(response[~np.eye(3, dtype=bool)] == 0.0)
    assert response[1, 1] == published("shoulder_pitch")[0].model.frequency_response(1.0)[0, 0, 0]
    assert hybrid.frequency_response(1.0)[0, 2, 2] == okid.frequency_response(1.0)[0, 2, 2]


def test_names_are_those_of_the_equations():
    assert {entry.label for entry in PUBLISHED} == set(TABLE) | {"ARMAX (4.9)"}
    for name, entry in BY_NAME.items():
        assert published_model(name) is entry
        assert entry.model.nu == entry.model.ny == len(entry.joints)
        assert entry.model.input_names == tuple(f"{joint} commanded" for joint in entry.joints)
        assert entry.model.dt == 0.02


def test_a_wrong_name_is_answered_with_those_that_exist():
    refused(r"did you mean '4\.10'.*5\.10, sysid, okid, hybrid", published_model, "4.100")


@pytest.mark.parametrize(("first", "second"), [("4.7", "4.9"), ("4.10", "4.11"), ("4.12", "4.13")])
def test_second_prints_agree_to_within_rounding(first, second):
    """No number of one print contradicts the other: a slip of the scan would."""
    one, other = EQUATIONS[first], EQUATIONS[second]
    assert one.doubts
    assert other.doubts
    for texts in zip(one.digits, other.digits, strict=True):
        for pair in zip(*(text.split() for text in texts), strict=True):
            # Zeros and ones of the structure have no place to round.
            unit = max(0.5 * 10.0 ** -len(number.partition(".")[2]) if "." in number else 0.0 for number in pair)
            assert abs(float(pair[0]) - float(pair[1])) <= 1.001 * unit, pair


def test_doubts_are_backed_by_numbers():
    gains = {name: EQUATIONS[name].dc_gain for name in ("4.7", "4.9", "4.7+4.9")}
    assert gains == pytest.approx({"4.7": 1.18, "4.9": 1.30, "4.7+4.9": 1.34}, abs=0.005)
    # (4.8) with the other sign of 0.1815
    misread = (0.0464 + 0.06144) / (1 - 0.7501 + 0.1815)
    assert misread == pytest.approx(0.25, abs=0.005)
    for name in ("5.8", "5.9", "5.10"):
        entry = EQUATIONS[name]
        assert np.abs(np.roots(entry.noise_polynomial)).max() < 0.25 < 0.4 < np.abs(entry.model.poles()).min()


@pytest.mark.slow
def test_ranges_hold_the_print_and_show_what_is_hardly_fixed():
    for entry in map(EQUATIONS.__getitem__, ("4.7", "4.7+4.9", "5.8", "5.9")):
        interval = entry.digit_range
        assert interval.bandwidth_hz[0] < entry.bandwidth_hz < interval.bandwidth_hz[1]
        assert interval.dc_gain[0] < entry.dc_gain < interval.dc_gain[1]
        assert interval.stable == 1.0
    rough, better, observer = (EQUATIONS[name].digit_range.dc_gain for name in ("4.7", "4.7+4.9", "5.8"))
    assert rough[1] - rough[0] > 0.5 > 0.1 > 0.01 > observer[1] - observer[0]
    assert rough[0] < better[0] < better[1] < rough[1]


def test_half_power_of_every_print_and_parts_of_a_system():
    assert all(0.1 < entry.half_power_hz < 1.5 for entry in EQUATIONS.values())
    system = published_model("hybrid")
    assert [part.name for part in system.parts] == ["4.7", "5.9", "5.10"]

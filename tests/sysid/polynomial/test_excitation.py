"""Order of excitation of signals whose order is known."""

import numpy as np
import pytest

from sysid import IOData, SysidError, SysidWarning, arx, oe, okid, order_of_excitation

T = np.arange(2000)


@pytest.mark.parametrize(
    ("signal", "order"),
    [
        (np.sin(0.3 * T), 2),
        (np.sin(0.3 * T) + np.sin(1.2 * T), 4),
        (1.0 + np.sin(0.3 * T), 3),
        (np.ones(2000), 1),
        (np.zeros(2000), 0),
        (np.random.default_rng(0).standard_normal(2000), 20),
        (np.where(T % 8 < 4, 1.0, -1.0), 4),
    ],
)
def test_known_orders(signal: np.ndarray, order: int) -> None:
    assert order_of_excitation(signal, max_order=20) == order


def test_one_input_at_a_time() -> None:
    with pytest.raises(SysidError, match="one input at a time"):
        order_of_excitation(np.ones((50, 2)), max_order=3)
    with pytest.raises(SysidError, match="max_order"):
        order_of_excitation(T[:10], max_order=6)


def test_constant_input_is_refused_everywhere() -> None:
    data = IOData(np.ones(100), np.random.default_rng(0).standard_normal(100), 0.1)
    for identify in (lambda: arx(data, 1, 1), lambda: oe(data, 1, 1), lambda: okid(data, 1, p=2)):
        with pytest.raises(SysidError, match="u1 is constant"):
            identify()


@pytest.mark.parametrize("value", [3.7, 1e6 / 3.0, -0.1, 1e-9])
@pytest.mark.parametrize("order", [0, 1])
def test_a_constant_input_stays_one_when_its_mean_is_removed(value: float, order: int) -> None:
    """Removing a mean leaves rounding behind, which would excite as noise does."""
    y = np.random.default_rng(0).standard_normal(333)
    data = IOData(np.full(333, value), y, 0.1).detrend(order)
    np.testing.assert_array_equal(data.u, 0.0)
    shaken = IOData(value * (1.0 + 4e-16 * np.sign(y)), y, 0.1)
    for given in (data, shaken, IOData(np.full(333, value), y, 0.1).subtract(u=value * (1 + 1e-15))):
        for identify in (lambda d: arx(d, 1, 1), lambda d: oe(d, 1, 1), lambda d: okid(d, 1, p=2)):
            with pytest.raises(SysidError, match="u1 is constant"):
                identify(given)


@pytest.mark.filterwarnings("ignore:the regressors have rank")
def test_two_sines_are_too_few_for_a_fifth_order_model() -> None:
    u = np.sin(0.3 * T) + np.sin(1.2 * T)
    y = np.convolve(u, [0.0, 1.0, 0.5])[:2000] + 0.01 * np.random.default_rng(0).standard_normal(2000)
    with pytest.warns(SysidWarning, match="exciting of order 4 only, the model needs 5"):
        estimate = arx(IOData(u, y, 0.02), 5, 5)
    assert "order 4 only" in estimate.diagnostics["warnings"][0]

import numpy as np
import pytest

from sysid import IOData
from sysid.validation.command_baseline import command_baseline

DT = 0.01


def test_a_pure_delay_is_recovered_and_its_fit_is_the_noise():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.standard_normal(200), 5)
    y = np.concatenate((np.full(7, u[0]), u[:-7]))
    noise = 0.05 * rng.standard_normal(1000)
    record = IOData(u, y + noise, DT)
    baseline = command_baseline([record], [record])
    assert baseline.delays == (7,)
    expected = 100.0 * (1.0 - np.sqrt(np.mean(noise**2)) / np.std(y + noise))
    np.testing.assert_allclose(baseline.fit, [expected])


def test_every_output_has_its_own_command_and_delay():
    rng = np.random.default_rng(1)
    u = rng.standard_normal((500, 2))
    y = np.column_stack((u[:, 0], np.concatenate((np.full(3, u[0, 1]), u[:-3, 1]))))
    baseline = command_baseline([IOData(u, y, DT)], [IOData(u, y, DT, window=100)])
    assert baseline.delays == (0, 3)
    np.testing.assert_allclose(baseline.fit, 100.0)


@pytest.mark.parametrize("units", [("V",), ("rad",)])
def test_other_units_have_no_such_model(units):
    u = np.random.default_rng(2).standard_normal(200)
    record = IOData(u, u, DT, input_units=units, output_units=("rad",))
    assert (command_baseline([record], [record]) is None) == (units == ("V",))
    wide = IOData(np.column_stack((u, u[::-1])), u, DT)
    assert command_baseline([wide], [wide]) is None

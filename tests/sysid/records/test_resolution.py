"""The steps of an encoder are found in a record, and nothing is found where there are none."""

import numpy as np
import pytest

from sysid.records.resolution import resolution

RNG = np.random.default_rng(1)
SMOOTH = np.cumsum(RNG.standard_normal(1000))


@pytest.mark.parametrize("step", [0.01, 2.0**-12, np.pi / 2000.0])
@pytest.mark.parametrize("offset", [0.0, 0.123456, -7e3])
def test_steps_are_found_about_any_level(step, offset):
    values = np.round(SMOOTH / step) * step + offset
    assert resolution(values) == pytest.approx(step, rel=1e-6)
    values[::7] = np.nan
    assert resolution(values) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize(
    "values",
    [
        SMOOTH,
        RNG.choice([-1.0, 1.0], 500),
        np.zeros(50),
        np.full(20, np.nan),
        np.convolve(RNG.choice([-1.0, 1.0], 500), 0.3 ** np.arange(30))[:500],
    ],
    ids=["smooth", "two levels", "constant", "missing", "sums of powers"],
)
def test_other_records_have_none(values):
    assert resolution(values) == 0.0

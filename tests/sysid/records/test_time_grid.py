import warnings

import numpy as np
import pytest

from sysid import SysidWarning
from sysid.records.time_grid import Signal, experiments, period
from tests.refusals import refused

N, DT = 400, 0.02


def drawn():
    """A new random generator, so that the numbers of a test do not depend on which tests ran before."""
    return np.random.default_rng(3)


# Stamps within 1 % of the grid would be moved there.
JITTER = np.append(0.0, drawn().choice([-1, 1], N - 1) * drawn().uniform(0.02, 0.2, N - 1))
JITTERED = DT * (np.arange(N) + JITTER)


def signal(times, values, name="y"):
    return Signal(times, values[:, None], (name,), ("",))


def integrator(times):
    """A held input and its integral."""
    u = drawn().standard_normal(len(times))
    return signal(times, u, "u"), signal(times, np.append(0.0, np.cumsum(u[:-1] * np.diff(times))))


def put(u, y, dt=None, *, missing=False, cut=False, says="", **options):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        parts = experiments([u], [y], dt, missing=missing, cut=cut, name="log.csv", **options)
    assert [one.category for one in caught] == [SysidWarning] * bool(says)
    assert all(text in str(one.message) for one in caught for text in says.split("|"))
    return parts


def increments(record):
    """Left and right sides of y(t + 1) - y(t) = dt u(t)."""
    return np.diff(record.y[:, 0]), record.dt * record.u[:-1, 0]


@pytest.mark.slow
def test_an_integrator_stays_one_when_jittering_samples_are_put_on_a_grid():
    says = f"log.csv: resampled every 0.02 s, as {N} stamps are|are interpolated linearly"
    (record,) = put(*integrator(JITTERED), says=says)
    assert (record.dt, len(record)) == (DT, int(JITTERED[-1] / DT) + 1)
    np.testing.assert_allclose(*increments(record), atol=1e-12)


def test_channels_with_stamps_of_their_own_are_put_on_the_grid_of_the_slowest_output():
    slow, fast = 0.1 * np.arange(40) + 0.025, 0.0125 * np.arange(330)
    u, y = integrator(fast)
    moved = signal(slow, np.interp(slow, y.times, y.values[:, 0]), "slow")
    (record,) = put(u, moved, says="resampled every 0.1 s, as u: 330 stamps|slow: 40 stamps")
    np.testing.assert_array_equal(record.y[:, 0], moved.values[:, 0])
    assert record.start == slow[0]
    np.testing.assert_allclose(*increments(record), atol=1e-12)
    early = moved._replace(times=slow - 9)
    refused("no time in common: u from 0 to .*; slow from -8.975 to", put, u, early)


def test_stamps_with_few_digits_and_those_of_a_stated_interval_are_taken_for_uniform_ones():
    u, y = integrator(np.round(np.arange(N) / 120, 3))
    (record,) = put(u, y, resolution=1e-3, says="log.csv: samples are taken as uniform, every 0.00833333 s")
    assert record.dt == 1 / 120
    np.testing.assert_array_equal(record.y, y.values)
    u, y = integrator(JITTERED)
    (record,) = put(u, y, DT, nominal=True, says="taken as uniform, every 0.02 s")
    np.testing.assert_array_equal(record.u, u.values)
    u, y = integrator(DT * (np.arange(N) + 1e-3 * drawn().standard_normal(N)))
    put(u, y)


def test_gaps_cut_a_record_also_where_outputs_may_be_missing():
    keep = np.setdiff1d(np.arange(N), [50, *range(100, 110), *range(200, 250), 251, 252, 253])
    u, y = (one._replace(times=one.times[keep], values=one.values[keep]) for one in integrator(DT * np.arange(N)))
    text = r"3 gap\(s\) above 2.5 intervals, the longest of 1.02 s after 3.98 s"
    refused(f"log.csv: not uniform: {text}; expected none", put, u, y)
    says = ": cut there into 3 experiment(s), 1 sample(s) between gaps left out|1 of 336 samples"
    parts = put(u, y, cut=True, says=text.replace("\\", "") + says)
    assert [(len(part), round(part.start / DT)) for part in parts] == [(100, 0), (90, 110), (146, 254)]
    empty = y._replace(values=np.where(np.arange(len(keep))[:, None] == 70, np.nan, y.values))
    lossy = put(u, empty, missing=True, cut=True, says=text.replace("\\", "") + ": cut there into 3")
    assert [(len(part), int((~part.known).sum())) for part in lossy] == [(100, 2), (90, 0), (146, 0)]


def test_a_table_is_cut_at_lost_rows_whose_inputs_nobody_knows():
    u, y = (
        one._replace(times=np.delete(one.times, [150, 290]), values=np.delete(one.values, [150, 290], axis=0))
        for one in integrator(DT * np.arange(N))
    )
    says = "2 row(s) lost between stamps, of which the inputs are not known: cut there into 3 experiment(s)"
    parts = put(u, y, cut=True, says=says)
    assert [len(part) for part in parts] == [150, 139, N - 291]
    for part in parts:
        np.testing.assert_allclose(*increments(part), atol=1e-12)


def test_lost_samples_are_missing_where_parts_would_be_short():
    lost = np.arange(30, N - 1, 40)
    u, y = (
        one._replace(times=np.delete(one.times, lost), values=np.delete(one.values, lost, axis=0))
        for one in integrator(DT * np.arange(N))
    )
    (record,) = put(u, y, cut=True, lost="missing", says=f"{len(lost)} of {N} samples are missing")
    np.testing.assert_array_equal(np.flatnonzero(~record.known[:, 0]), lost)
    (record,) = put(u, y, cut=True, says=f"{len(lost)} of {N} samples of the outputs are interpolated")
    assert record.complete
    (record,) = put(u, y, cut=True, missing=True, lost="interpolated", says="samples of the outputs are interpolated")
    assert record.complete
    # NaN of the file is refused all the same.
    y.values[3] = np.nan
    refused("NaN or infinite, the first in channel 0 at index 3", put, u, y, cut=True, lost="missing")


def test_a_late_sample_is_no_lost_row():
    times = DT * np.arange(N)
    times[200] += 0.7 * DT
    u, y = integrator(times)
    (record,) = put(u, y, cut=True, says="1 of 400 samples of the outputs are interpolated linearly")
    assert len(record) == N


@pytest.mark.parametrize(
    ("true", "spread"),
    [(0.02, 0.2), (1 / 30, 0.2), (1 / 60, 0.2), (1 / 120, 0.2), (0.0125, 0.2), (0.005, 0.3), (0.0200001, 0.0)],
)
def test_jitter_and_losses_do_not_change_the_interval(true, spread):
    rng = drawn()
    for _ in range(50):
        times = true * (np.arange(N) + spread * rng.uniform(-0.5, 0.5, N))
        assert period(np.delete(times, [40, 41, 90]), "y", "log") == pytest.approx(true, rel=1e-12)


@pytest.mark.parametrize("rate", [48.7, 33.3, 23.976])
def test_stamps_of_two_digits_keep_their_rate(rate):
    """Steps of one and a half times the median, 0.03 and 0.02 s, are no losses."""
    times = np.round(np.arange(3000) / rate, 2)
    found = period(times, "y", "log")
    assert abs(found * (len(times) - 1) - times[-1]) <= 0.02


def test_stamps_without_a_rate_are_refused():
    random = np.cumsum(drawn().exponential(1, N))
    refused(r"y is not uniform: steps from .* outside 0\.5 to 1\.5 times", period, random, "y", "log")
    even = signal(DT * np.arange(N), np.ones(N))
    refused(rf"log.csv: 79800001 samples every 1e-07 s from {N} stamps", put, even, even, 1e-7)
    once = signal(np.zeros(1), np.ones(1))
    refused(r"y has 1 sample\(s\), expected at least 2", put, once, once)

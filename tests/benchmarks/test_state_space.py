"""State-space estimators on the problem `mimo`: accuracy, and time beside SLICOT and a least-squares solve.

Output noise is white or of first order with a pole at 0.9. The error is that of 200 values of the pulse response, in
percent of its norm. SLICOT's N4SID comes from the wheel `ctrlsys` where that is installed; its options that ask for
covariances or for the Kalman gain are left alone: they return another model, or corrupt the memory of the process.
"""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.signal import lfilter

import sysid
from scenarios.problems.linear_problem import BURN_IN
from scenarios.problems.registry import problem
from sysid.polynomial.least_squares import solve
from sysid.subspace.observer_regression import ObserverRegression
from tests.benchmarks.tables import timed

ORDER = 10


def draw(seed, coloured):
    known = problem("mimo")
    u, y = known.inputs[BURN_IN:], known.noise_free[BURN_IN:]
    noise = np.random.default_rng(seed).standard_normal((3, len(u) + 300))
    if coloured:
        noise = lfilter([1.0], [1.0, -0.9], noise, axis=1)
        noise /= noise.std(axis=1, keepdims=True)
    return sysid.IOData(u, y + noise[:, 300:].T * y.std(axis=0) / 10.0, known.truth.dt)


def percent(model):
    expected = problem("mimo").truth.markov(200)
    return 100.0 * float(np.linalg.norm(model.markov(200) - expected) / np.linalg.norm(expected))


def fastest(run, rounds=7):
    """Least processor time of several runs in ms."""
    return 1e3 * min(timed(run)[1] for _ in range(rounds))


def slicot(data, block_rows, order=ORDER):
    ctrlsys = pytest.importorskip(
        "ctrlsys", reason="SLICOT's wheel `ctrlsys` is not installed: no peer to compare with"
    )
    u, y = np.asfortranarray(data.u), np.asfortranarray(data.y)
    factor = ctrlsys.ib01ad("N", "C", "N", "O", "N", "N", block_rows, data.nu, data.ny, u, y, 0.0, -1.0)[1]
    A, C, B, D = ctrlsys.ib01bd("N", "A", "N", block_rows, order, data.nu, data.ny, len(u), factor, 0.0)[:4]
    return sysid.StateSpace(A, B, C, D, None, data.dt)


def refined(data, direct=True):
    return sysid.pem_ss(data, sysid.n4sid(data, ORDER), gain=False, direct=direct).model


@pytest.mark.parametrize(("coloured", "direct", "limit"), [(False, True, 0.8), (True, True, 1.1), (False, False, 0.69)])
def test_refined_model_is_as_accurate_as_can_be(coloured, direct, limit):
    records = [draw(seed, coloured) for seed in range(12)]
    ours = [percent(refined(data, direct)) for data in records]
    first = [percent(sysid.n4sid(data, ORDER).model) for data in records]
    print(f"\ncoloured {coloured}, D free {direct}: pem_ss {np.mean(ours):.3f} %, n4sid {np.mean(first):.3f} %")
    assert np.mean(ours) <= limit


@pytest.mark.parametrize("coloured", [False, True])
def test_refined_from_okid_ends_at_the_same_model(coloured):
    data = draw(0, coloured)
    start = sysid.okid(data, ORDER, p=40)
    again = sysid.pem_ss(data, start, gain=False).model
    print(f"\nokid {percent(start.model):.3f} %, refined {percent(again):.3f} %")
    assert percent(again) == pytest.approx(percent(refined(data)), rel=0.01)


def test_time_beside_slicot():
    for coloured in (False, True):
        data = draw(0, coloured)
        start = sysid.n4sid(data, ORDER)
        times = {
            "n4sid": fastest(lambda data=data: sysid.n4sid(data, ORDER)),
            "pem_ss": fastest(lambda data=data, start=start: sysid.pem_ss(data, start, gain=False)),
        }
        theirs = {rows: fastest(lambda data=data, rows=rows: slicot(data, rows)) for rows in (15, 25)}
        total = times["n4sid"] + times["pem_ss"]
        errors = {rows: percent(slicot(data, rows)) for rows in (15, 25)}
        for rows, theirs_ms in theirs.items():
            longer = ", ".join(f"{name} {ours / theirs_ms:.1f}" for name, ours in times.items())
            print(f"\ncoloured {coloured}: SLICOT, {rows} block rows: {theirs_ms:.1f} ms, {errors[rows]:.2f} %", end="")
            print(f"; times longer: {longer}; both together {total / theirs_ms:.1f}")
        print(f"ours: {times['n4sid']:.0f} ms + {times['pem_ss']:.0f} ms")
        # at the block rows at which SLICOT is at its best
        assert times["pem_ss"] <= 30.0 * theirs[25]
        assert total < 500.0


def random_record(order, channels, samples):
    """A record of a stable system with as many inputs as outputs, noise of a tenth of the outputs."""
    rng = np.random.default_rng(order)
    blocks = []
    for radius, angle in zip(rng.uniform(0.6, 0.95, order // 2), rng.uniform(0.1, 2.5, order // 2), strict=True):
        cosine, sine = radius * np.cos(angle), radius * np.sin(angle)
        blocks.append([[cosine, -sine], [sine, cosine]])
    B, C = rng.standard_normal((order, channels)), rng.standard_normal((channels, order))
    truth = sysid.StateSpace(block_diag(*blocks), B, C, np.zeros((channels, channels)), None, 0.1)
    u = rng.standard_normal((samples, channels))
    y = sysid.simulate(truth, u)
    return sysid.IOData(u, y + 0.1 * y.std(axis=0) * rng.standard_normal(y.shape), 0.1)


def test_time_of_n4sid_beside_slicot():
    """The same record, order and block rows; ours also has K, the residuals, and the warnings of the data."""
    ratios = {}
    for order in (4, 8):
        for channels in (1, 2):
            for samples in (1000, 10_000, 100_000):
                data = random_record(order, channels, samples)
                rows = sysid.n4sid(data, order).diagnostics["block_rows"]
                slicot(data, rows, order)
                ours = fastest(lambda data=data, order=order: sysid.n4sid(data, order))
                theirs = fastest(lambda data=data, order=order, rows=rows: slicot(data, rows, order))
                ratios[order, channels, samples] = ours / theirs
                print(f"\norder {order}, {channels} x {channels}, {samples} samples, {rows} block rows: ", end="")
                print(f"n4sid {ours:.1f} ms, SLICOT {theirs:.2f} ms, ratio {ours / theirs:.1f}", end="")
    print()
    assert ratios[8, 2, 100_000] <= 6.0


@pytest.mark.parametrize("p", [20, 40])
def test_okid_beside_its_own_least_squares(p):
    data = draw(0, False)
    regression = ObserverRegression([data], p, direct=True, at_rest=False)
    phi, y = np.split(np.vstack(list(regression.blocks())), [regression.width], axis=1)
    ours = fastest(lambda: sysid.okid(data, ORDER, p=p, realiser=sysid.era_dc))
    plain = fastest(lambda: np.linalg.lstsq(phi, y, rcond=None))
    fast = fastest(lambda: solve(phi, y))
    print(f"\np = {p}: okid + era_dc {ours:.1f} ms; numpy's solve {plain:.1f} ms, ours {fast:.1f} ms")
    assert ours <= 3.0 * fast

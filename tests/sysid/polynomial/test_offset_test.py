import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData

FITS = {
    "oe": lambda data: sysid.oe(data, 1, 1),
    "armax": lambda data: sysid.armax(data, 1, 1, 1),
    "bj": lambda data: sysid.bj(data, 1, 1, 1, 1),
    "arx": lambda data: sysid.arx(data, 1, 1),
    "n4sid": lambda data: sysid.n4sid(data, 1),
    "pem_ss": lambda data: sysid.pem_ss(data, 1),
    "tfest": lambda data: sysid.tfest(data, 1, 0),
    "procest": lambda data: sysid.procest(data, "P1"),
}


def warned_of_offset(fit, data):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = fit(data)
    texts = [str(warning.message) for warning in caught if "offset" in str(warning.message)]
    # what is warned of stands in the estimate too
    assert [text for text in model.diagnostics["warnings"] if "offset" in text][-1:] == texts[-1:]
    return texts


def held(rng, samples, hold=15):
    return np.repeat(rng.choice([-1.0, 1.0], samples // hold), hold)


@pytest.mark.parametrize(
    ("name", "noise"),
    # a noise model with a root at one follows the offset, and leaves the gain alone: bj needs no remark
    [(name, noise) for name in ("oe", "armax", "n4sid", "pem_ss", "tfest", "procest") for noise in (0.05, 0.5)]
    + [("arx", 0.05)],
)
def test_a_mean_of_a_transient_is_told(name, noise):
    # the transient from 60 has a time constant of a sixth of the record: its mean stays as an offset of about -10
    rng = np.random.default_rng(3)
    u = held(rng, 300)
    y = lfilter([0.0, 0.3], [1.0, -0.98], u) + 60.0 * 0.98 ** np.arange(300) + noise * rng.standard_normal(300)
    (text,) = warned_of_offset(FITS[name], IOData(u, y, 0.02).detrend())[-1:]
    assert "offset of the output, about -" in text
    assert "y1" in text


@pytest.mark.parametrize("name", ["oe", "armax", "tfest"])
def test_of_several_experiments_the_one_with_the_offset_is_named(name):
    rng = np.random.default_rng(4)
    records = []
    for k, start in enumerate((0.0, 60.0)):
        u = held(rng, 300)
        y = lfilter([0.0, 0.3], [1.0, -0.98], u) + start * 0.98 ** np.arange(300) + 0.1 * rng.standard_normal(300)
        offset = 10.0 if k else 0.0
        records.append(IOData(u, y - offset, 0.02, name=f"run{k}"))
    texts = warned_of_offset(FITS[name], records)
    assert texts
    assert "in experiment run1" in texts[-1]


@pytest.mark.parametrize("name", FITS)
def test_no_false_alarm_beside_slow_noise(name):
    told = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = held(rng, 600, 5)
        noise = lfilter([1.0], [1.0, -0.9], rng.standard_normal(600))
        y = lfilter([0.0, 0.3], [1.0, -0.8], u) + 0.1 * noise
        told += bool(warned_of_offset(FITS[name], IOData(u, y, 0.02).detrend()))
    assert told == 0

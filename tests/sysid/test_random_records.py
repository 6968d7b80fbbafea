"""Every estimator returns a result or a `SysidError`, whatever the record."""

import numpy as np
import pytest

from tests.sysid.random_records import failure, random_calls, random_record


def _failures(seeds, calls_each):
    failures = {}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        record, calls = random_record(rng), random_calls(rng)
        names = rng.permutation(list(calls))[:calls_each]
        for name in names:
            message = failure(calls[name], record)
            if message is not None:
                failures[seed, str(name)] = message
    return failures


@pytest.mark.slow
def test_small_random_records():
    assert _failures(range(60), calls_each=2) == {}


@pytest.mark.parametrize(
    ("seed", "name"),
    [
        (1080, "tfest"),
        (1181, "auto"),
        (1211, "polyest"),
        (1314, "arma"),
        (1352, "cross_validate"),
        (1373, "polyest"),
        (1378, "cross_validate"),
        (1446, "okid"),
        (1603, "ivx"),
        (1679, "auto"),
        (1763, "delayest"),
        (1763, "impulseest"),
        (1792, "model_error"),
        (1810, "procest"),
        (1820, "delayest"),
        (1891, "delayest"),
        (1900, "procest"),
        (1916, "pbsid"),
        (1962, "auto"),
        (1962, "model_error"),
        (1996, "procest"),
        (2204, "procest"),
        (2204, "tfest"),
        (2267, "pem_ss"),
        (2425, "tfest"),
        (2441, "pbsid"),
        (2930, "arx with a prior"),
        (2956, "arma"),
    ],
)
def test_records_that_once_ended_in_other_errors(seed, name):
    rng = np.random.default_rng(seed)
    record, calls = random_record(rng), random_calls(rng)
    assert failure(calls[name], record) is None


@pytest.mark.thorough
@pytest.mark.parametrize("first", range(1000, 3000, 50))
def test_many_small_random_records(first):
    # a third of the calls of 2,000 records: two hours of processor time, in parts that run side by side
    assert _failures(range(first, first + 50), calls_each=14) == {}

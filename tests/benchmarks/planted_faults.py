"""Which figures each estimator that is wrong on purpose must fail, and why: exactly these, and no other.

Its faults are those of `faulty_estimators`. `python tests/benchmarks/bench_sets.py faults` holds the bench to it.
"""

_RESPONSE_WRONG = {
    "noise_free_recovery": "the response is as wrong without noise",
    "consistency": "the error does not shrink with the number of samples",
    "efficiency": "it is a bias, larger than the deviation of the bound",
    "coverage": "intervals that do not know of it miss the truth",
    "normalised_error": "it is many claimed deviations",
    "frequency_response": "it leaves the claimed band",
    "bias": "it is there in closed loop too",
    "tests_and_orders": "residuals of records with little noise hold what the model leaves of the input",
    "agreement": "the second implementation does not have it",
}


def _claims(often, times):
    return {
        "coverage": f"95 % intervals hold the truth too {often}",
        "normalised_error": f"its mean is {times}, not one",
        "frequency_response": f"its mean square in claimed deviations is {times}, not one",
    }


def _failures(what):
    return {"reliability": f"{what} is a failure, and all other figures leave it out"}


PLANTED_FAULTS = {
    "delayed": {
        **_RESPONSE_WRONG,
        "amplitude_split": "a sample is a tenth of the response and more on the arm, two to five percent allowed",
    },
    "overconfident": _claims("seldom", "two"),
    "underconfident": _claims("often", "a half"),
    # 2 % are within what the split over amplitude allows
    "biased": _RESPONSE_WRONG,
    # it claims the variance that it has
    "inefficient": {"efficiency": "its variance is one and a half times the bound"},
    "unstable": _failures("an unstable model"),
    "slow": {"speed": "it takes more than 1200 rulers"},
    "crashing": _failures("a process that dies"),
    "hungry": _failures("a process beyond its limit of memory"),
    "hanging": _failures("no answer in time"),
    "absent-minded": _failures("a model of NaN"),
}
"""Reasons by the names of figure and estimator."""

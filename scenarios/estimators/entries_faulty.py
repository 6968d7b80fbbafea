"""Entries of the estimators that are wrong on purpose."""

from scenarios.estimators.catalogue_entry import Entry
from scenarios.estimators.contestant import Contestant


def _entry(name: str, fault: str) -> Entry:
    return Entry(
        Contestant(
            name.replace("_", "-"),
            f"scenarios.estimators.faulty:{name}",
            method="pem",
            settings=f"wrong on purpose: {fault}",
        )
    )


FAULTY = (
    _entry("delayed", "its model answers one sample late"),
    _entry("overconfident", "it claims half of its covariance"),
    _entry("underconfident", "it claims twice its covariance"),
    _entry("biased", "its gain is 2 % too high"),
    _entry("inefficient", "its variance is 1.5 times the best, and it says so"),
    _entry("unstable", "one model in fifty is unstable"),
    _entry("slow", "it repeats its fit until 1800 rulers of processor time have gone, where orders are given"),
    _entry("crashing", "one fit in fifty ends its process"),
    _entry("hungry", "one fit in fifty takes 8 GB of memory"),
    _entry("hanging", "one fit in fifty never ends"),
    _entry("absent_minded", "one model in fifty is NaN"),
)
"""The planted faults."""

"""Where everything stands in the folder of a data set."""

from pathlib import PurePosixPath

PARTS = ("train", "validation", "test")
"""What a record is for: to identify from, to choose a model by, and to score it on."""

DATA = "data"
"""Folder of what an analyst may see: `data/<part>/<experiment>.nc`."""

TRUTH = "truth"
"""Folder of what only a simulation knows; it travels beside the data and can be kept apart."""

SPEC = "spec.toml"
"""The spec, all defaults written out, from which the data set can be built again."""

JOURNAL = "journal.sqlite"
"""Finished work of a build, from which it resumes; gone from a data set that is done."""

INDEX = "experiments.json"
"""Every experiment with its part, joints, seeds, conditions, file and array hashes, in the order of the plan; and the
pieces of the stages."""

BUILD = "build.json"
"""Which software the data set was built with."""

SUMS = "SHA256SUMS"
"""Checksum of every other file."""

BASELINES = "baselines.csv"
"""What known methods reach, a row for each."""

ATTAINABLE = "truth/attainable.csv"
"""What any model could reach, a row for each scored record and output."""

LICENSE = "CC-BY-4.0"
"""SPDX identifier of the licence of the data."""

UNFINISHED = ".unfinished"
"""Ending of the folder while the data set is being built."""


def data_file(part: str, experiment: str) -> PurePosixPath:
    """Where the record of an experiment stands."""
    return PurePosixPath(DATA, part, f"{experiment}.nc")


def signals_file(experiment: str) -> PurePosixPath:
    """Where the signals that only the simulation knows stand."""
    return PurePosixPath(TRUTH, "signals", f"{experiment}.nc")


def arm_file(arm: str) -> PurePosixPath:
    """Where the small-signal truth of an arm under its conditions stands."""
    return PurePosixPath(TRUTH, "arms", f"{arm}.nc")


def best_linear_file(experiment: str) -> PurePosixPath:
    """Where the best linear approximation for the conditions of an experiment stands."""
    return PurePosixPath(TRUTH, "best-linear", f"{experiment}.nc")


def attainable_file(experiment: str) -> PurePosixPath:
    """Where all floors of a scored record stand."""
    return PurePosixPath(TRUTH, "attainable", f"{experiment}.json")


def baseline_file(method: str) -> PurePosixPath:
    """Where the scores of a baseline on every record stand.

    Args:
        method: As it is written in a spec, ``"oe:2/2/1"``.
    """
    return PurePosixPath("baselines", f"{method.replace(':', '-').replace('/', '-')}.json")

"""Names of the files in the folder of a data set."""

from pathlib import PurePosixPath

PARTS = ("train", "validation", "test")
"""Purposes of records: to identify from, to choose a model by, and to score it on."""

DATA = "data"
"""Folder of what an analyst may see: `data/<part>/<experiment>.nc`."""

TRUTH = "truth"
"""Folder of what only a simulation knows; a copy of the data set may lack it."""

SPEC = "spec.toml"
"""The spec, all defaults written out, from which the data set can be built again."""

JOURNAL = "journal.sqlite"
"""Finished work of a build, from which it resumes; gone from a data set that is done."""

INDEX = "experiments.json"
"""Every experiment with its part, joints, seeds, conditions, file and array hashes, in the order of the plan; and the
pieces of the stages."""

BUILD = "build.json"
"""Software that the data set was built with."""

SUMS = "SHA256SUMS"
"""Checksum of every other file."""

BASELINES = "baselines.csv"
"""Scores of known methods, a row for each."""

ATTAINABLE = "truth/attainable.csv"
"""Best attainable scores, a row for each scored record and output."""

LICENSE = "CC-BY-4.0"
"""SPDX identifier of the licence of the data."""

UNFINISHED = ".unfinished"
"""Ending of the folder while the data set is being built."""


def data_file(part: str, experiment: str) -> PurePosixPath:
    """Return the path of the record of an experiment."""
    return PurePosixPath(DATA, part, f"{experiment}.nc")


def signals_file(experiment: str) -> PurePosixPath:
    """Return the path of the signals that only the simulation knows."""
    return PurePosixPath(TRUTH, "signals", f"{experiment}.nc")


def arm_file(arm: str) -> PurePosixPath:
    """Return the path of the small-signal truth of an arm under its conditions."""
    return PurePosixPath(TRUTH, "arms", f"{arm}.nc")


def best_linear_file(experiment: str) -> PurePosixPath:
    """Return the path of the best linear approximation for the conditions of an experiment."""
    return PurePosixPath(TRUTH, "best-linear", f"{experiment}.nc")


def attainable_file(experiment: str) -> PurePosixPath:
    """Return the path of all floors of a scored record."""
    return PurePosixPath(TRUTH, "attainable", f"{experiment}.json")


def baseline_file(method: str) -> PurePosixPath:
    """Return the path of the scores of a baseline, written as in a spec, ``"oe:2/2/1"``, on every record."""
    return PurePosixPath("baselines", f"{method.replace(':', '-').replace('/', '-')}.json")

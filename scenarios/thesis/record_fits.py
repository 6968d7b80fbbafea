"""Fits of the three-joint models to sets of records, beside those of the truth."""

from collections.abc import Collection, Iterable, Mapping
from statistics import median

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.campaign import OTHER_WAVEFORMS, plays_identified_sequence
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.multivariable import Kind, Way
from scenarios.thesis.number_text import minus
from scenarios.thesis.reference_fits import BEST_LINEAR, DIAGONAL, LINEAR, NOISELESS, best_linear_fits, reference_fits
from scenarios.thesis.verdicts import tied, without_noise_model

Records = tuple[Iterable[int], Iterable[str]]
"""Numbers of single-joint tests, and names of records of several joints."""


def fits_to_records(study: Comparison, kind: Kind, joint: str, records: Records, way: Way) -> dict[str, float]:
    """Fits of one joint of a model to single-joint tests and records of several joints, by record, percent.

    Raises:
        MissingRecordError: One of the records is missing: fits to others would be an answer to another question.
    """
    entry, several = study.joints[joint], study.multivariable.model(kind)
    single = entry.models["okid"] if kind == "OKID" else entry.chosen
    fits = {}
    for number in records[0]:
        study.campaign.log(single_joint_test(number, joint))
        fits[f"siso-{number}"] = getattr(single.fits[number], way)
    return fits | {name: several.fit(name).of(way)[joint] for name in records[1]}


def held_out_records(study: Comparison, joint: str) -> Records:
    """Available records of a joint that play another waveform than the estimation test."""
    there = study.joints[joint].data
    return (
        tuple(number for number in OTHER_WAVEFORMS if number in there and number != study.estimation_test),
        tuple(name for name in study.multivariable.records if not plays_identified_sequence(name)),
    )


def held_out_fit(study: Comparison, kind: Kind, joint: str, way: Way) -> float:
    """Median fit of one joint of a model to `held_out_records`, percent.

    Raises:
        MissingRecordError: No such record is left.
    """
    fits = fits_to_records(study, kind, joint, held_out_records(study, joint), way)
    if not fits:
        raise MissingRecordError(f"no record of {joint} is left that the models were not identified from")
    return median(fits.values())


def within_reach(study: Comparison, names: Collection[str]) -> str:
    """In words: what the best linear truth follows of records of several joints, and what coupling is worth there.

    A sentence without its full stop; of medians where there are several records.
    """
    fits = [_truths(study, name) for name in names]
    best, alone, whole = (np.median([list(one[kind].values()) for one in fits], axis=0) for kind in LINEAR)
    own, okid = (
        np.median([list(entry.fit(name).simulation.values()) for name in names], axis=0)
        for entry in study.multivariable.pair()
    )
    where = "In the median of the records of several joints" if len(names) > 1 else f"On {next(iter(names))}"
    listed = "/".join(minus(f"{fit:.1f}") for fit in best)
    return (
        f"{where} the best linear truth of each joint under the PRBS follows {listed} % (yaw, shoulder pitch, elbow "
        f"pitch); coupling, which neither model has, is worth up to {np.max(whole - alone):.1f} points to the truth "
        f"without friction, while the two models differ by up to {np.abs(okid - own).max():.1f} in simulation"
    )


def _truths(study: Comparison, name: str) -> dict[str, Mapping[str, float]]:
    """Fits of the truth to a record of any name, by kind and joint."""
    truth, known = study.multivariable.truth, study.multivariable.references
    if name not in known[DIAGONAL]:
        known = reference_fits(study.campaign, (name,), truth)
    best = {joint: entry.best_linear.response for joint, entry in study.joints.items()}
    fits = {kind: of_records[name] for kind, of_records in known.items()}
    return {**fits, BEST_LINEAR: best_linear_fits(study.campaign, name, truth, best)}


def missing_fit_shares(study: Comparison, joint: str, record: str, fit: float) -> dict[str, float]:
    """Shares of what a fit lacks, percentage points; their sum is 100 minus the fit.

    What the best linear truth of the joint follows more than the model, what coupling is worth to the truth without
    friction, what the true angles follow beyond both, and the noise of reading them. The first is negative where errors
    of the model stand for something that the truth of the joint alone does not have.
    """
    truths = _truths(study, f"{record}-{joint}" if record.startswith("siso") else record)
    best, alone, whole, true = (truths[kind][joint] for kind in (*LINEAR, NOISELESS))
    return {
        "the model's own error": best - fit,
        "coupling": whole - alone,
        "all that is not linear": true - best - (whole - alone),
        "the noise of reading": 100.0 - true,
    }


def remarks(study: Comparison, differences: Mapping[str, float]) -> dict[str, object]:
    """In words: which differences of fits are `ties`, and where the SysID model cannot predict (`noise`)."""
    return {"ties": ties(differences), "noise": without_noise_model(study.multivariable.pair()[0])}


def ties(differences: Mapping[str, float]) -> str:
    """In words: which differences of fits are ties; nothing where none is."""
    joints = [name.replace("_", " ") for name, value in differences.items() if tied(value)]
    return f"tied: {'; '.join(joints)}" if joints else "nothing is tied"

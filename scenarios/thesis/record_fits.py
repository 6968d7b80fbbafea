"""Fits of the three-joint models to sets of records, beside those of the truth."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from statistics import median

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.campaign import OTHER_WAVEFORMS, plays_identified_sequence
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.multivariable import Kind, Way
from scenarios.thesis.number_text import minus
from scenarios.thesis.reference_fits import (
    BEST_LINEAR,
    COUPLED,
    DIAGONAL,
    LINEAR,
    NOISELESS,
    best_linear_fits,
    reference_fits,
)
from scenarios.thesis.verdicts import tied, without_noise_model

Records = tuple[Iterable[int], Iterable[str]]
"""Numbers of single-joint tests, and names of records of several joints."""


def fits_to_records(study: Comparison, kind: Kind, joint: str, records: Records, way: Way) -> dict[str, float]:
    """Fits of one joint of a model to single-joint tests and records of several joints, by record, percent.

    Raises:
        MissingRecordError: One of the records is missing: fits to others would be an answer to another question.
    """
    single_joint_tests, several_joints = records
    result, three_joint_model = study.joints[joint], study.multivariable.model(kind)
    model = result.models["okid"] if kind == "OKID" else result.chosen
    fits = {}
    for test in single_joint_tests:
        # Raises where the test failed or was not played.
        study.campaign.log(single_joint_test(test, joint))
        fits[f"siso-{test}"] = getattr(model.fits[test], way)
    for name in several_joints:
        fits[name] = three_joint_model.fit(name).of(way)[joint]
    return fits


def held_out_records(study: Comparison, joint: str) -> Records:
    """Available records of a joint that play another waveform than the estimation test."""
    available = study.joints[joint].data
    single_joint_tests = tuple(test for test in OTHER_WAVEFORMS if test in available and test != study.estimation_test)
    # A model has seen its own sequence, in whatever test it is played again.
    several_joints = tuple(name for name in study.multivariable.records if not plays_identified_sequence(name))
    return single_joint_tests, several_joints


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
    fits_of_truths = [_truths(study, name) for name in names]
    best = _median_by_joint([fits[BEST_LINEAR] for fits in fits_of_truths])
    uncoupled = _median_by_joint([fits[DIAGONAL] for fits in fits_of_truths])
    coupled = _median_by_joint([fits[COUPLED] for fits in fits_of_truths])
    prediction_error, okid = study.multivariable.pair()
    of_prediction_error = _median_by_joint([prediction_error.fit(name).simulation for name in names])
    of_okid = _median_by_joint([okid.fit(name).simulation for name in names])
    scope = "In the median of the records of several joints" if len(names) > 1 else f"On {next(iter(names))}"
    listed = "/".join(minus(f"{fit:.1f}") for fit in best)
    coupling, difference = np.max(coupled - uncoupled), np.abs(of_okid - of_prediction_error).max()
    return (
        f"{scope} the best linear truth of each joint under the PRBS follows {listed} % (yaw, shoulder pitch, elbow "
        f"pitch); coupling, which neither model has, is worth up to {coupling:.1f} points to the truth "
        f"without friction, while the two models differ by up to {difference:.1f} in simulation"
    )


def _median_by_joint(fits_of_records: Sequence[Mapping[str, float]]) -> np.ndarray:
    """Median over records of the fits (joints,)."""
    return np.asarray(np.median([list(fits.values()) for fits in fits_of_records], axis=0))


def _truths(study: Comparison, name: str) -> dict[str, Mapping[str, float]]:
    """Fits of the truth to a record of any name, by kind and joint."""
    truth, references = study.multivariable.truth, study.multivariable.references
    # The study has them of the records of several joints; those of single-joint tests are computed when asked for.
    if name not in references[DIAGONAL]:
        references = reference_fits(study.campaign, (name,), truth)
    fits = {kind: of_records[name] for kind, of_records in references.items()}
    best_linear = {joint: result.best_linear.response for joint, result in study.joints.items()}
    return {**fits, BEST_LINEAR: best_linear_fits(study.campaign, name, truth, best_linear)}


def missing_fit_shares(study: Comparison, joint: str, record: str, fit: float) -> dict[str, float]:
    """Shares of what a fit lacks, percentage points; their sum is 100 minus the fit.

    What the best linear truth of the joint follows more than the model, what coupling is worth to the truth without
    friction, what the true angles follow beyond both, and the noise of reading them. The first is negative where errors
    of the model stand for something that the truth of the joint alone does not have.
    """
    log_name = f"{record}-{joint}" if record.startswith("siso") else record
    truths = _truths(study, log_name)
    best, uncoupled, coupled, noiseless = (truths[kind][joint] for kind in (*LINEAR, NOISELESS))
    return {
        "the model's own error": best - fit,
        "coupling": coupled - uncoupled,
        "all that is not linear": noiseless - best - (coupled - uncoupled),
        "the noise of reading": 100.0 - noiseless,
    }


def remarks(study: Comparison, differences: Mapping[str, float]) -> dict[str, object]:
    """Describe which differences of fits are ties (`ties`) and which SysID models cannot predict (`noise`)."""
    return {"ties": ties(differences), "noise": without_noise_model(study.multivariable.pair()[0])}


def ties(differences: Mapping[str, float]) -> str:
    """Name the joints whose fits differ too little to rank the methods."""
    joints = [name.replace("_", " ") for name, value in differences.items() if tied(value)]
    return f"tied: {'; '.join(joints)}" if joints else "nothing is tied"

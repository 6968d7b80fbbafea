"""Fits of the three-joint models to sets of records, and the part of a record that needs coupling."""

from collections.abc import Iterable, Mapping
from statistics import median

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.campaign import OTHER_WAVEFORMS, plays_identified_sequence
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.multivariable import Kind, Way
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL, NOISELESS, reference_fits
from scenarios.thesis.verdicts import tied

Records = tuple[Iterable[int], Iterable[str]]
"""Numbers of single-joint tests, and names of records of several joints."""


def fits_to_records(study: Comparison, kind: Kind, joint: str, records: Records, way: Way) -> dict[str, float]:
    """Fits of one joint of a model to all given single-joint tests and records of several joints.

    Args:
        study: The study.
        kind: Which model.
        joint: The joint.
        records: The records.
        way: In simulation or one step ahead.

    Returns:
        Fits by record, percent.

    Raises:
        MissingRecordError: One of the records is missing: fits to others would be an answer to another question.
    """
    entry, several = study.joints[joint], study.multivariable.model(kind)
    single = entry.models["okid"] if kind == "OKID" else entry.chosen
    fits = {}
    for number in records[0]:
        if number not in single.fits:
            name = single_joint_test(number, joint)
            study.campaign.log(name)
            raise MissingRecordError(f"the models of {joint} were not compared with {name}")
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
    """Median fit of one joint of a model to all held-out records, of one joint and of several, percent.

    Args:
        study: The study.
        kind: Which model.
        joint: The joint.
        way: In simulation or one step ahead.

    Returns:
        The median over `held_out_records`.

    Raises:
        MissingRecordError: No such record is left.
    """
    fits = fits_to_records(study, kind, joint, held_out_records(study, joint), way)
    if not fits:
        raise MissingRecordError(f"no record of {joint} is left that the models were not identified from")
    return median(fits.values())


def within_reach(study: Comparison, records: Iterable[str]) -> str:
    """In words: what the linear truth follows without its coupling and with it, and what two models differ by there.

    Args:
        study: The study.
        records: Records of several joints, one at least.

    Returns:
        A sentence without its full stop; medians where there are several records.
    """
    names = tuple(records)
    alone, whole = (
        [median(study.multivariable.reference(kind, name)[joint] for name in names) for joint in STUDIED_JOINTS]
        for kind in (DIAGONAL, COUPLED)
    )
    own, okid = (
        [median(entry.fit(name).simulation[joint] for name in names) for joint in STUDIED_JOINTS]
        for entry in study.multivariable.pair()
    )
    lost = [b - a for a, b in zip(alone, whole, strict=True)]
    differ = max(abs(b - a) for a, b in zip(own, okid, strict=True))
    where = f"On {names[0]}" if len(names) == 1 else "In the median of the records of several joints"
    return (
        f"{where} the linear truth itself follows {_list_text(alone)} % (yaw, shoulder pitch, elbow pitch) without its "
        f"coupling and {_list_text(whole)} % with it: coupling, which neither model has, costs up to {max(lost):.1f} "
        f"points, "
        f"while the two models differ by up to {differ:.1f} in simulation"
    )


def shortfall(study: Comparison, joint: str, record: str, fit: float) -> str:
    """In words: what takes how much of a simulation's fit, from the model's own error to the noise of reading.

    Each share is what the fit gains from one kind of knowledge to the next: the model, the linear truth of the joint by
    its own command, by all commands, the true angles. The first is negative where errors of the model stand for
    something that the truth of the joint alone does not have.

    Args:
        study: The study.
        joint: The joint.
        record: `siso-1` to `siso-8`, or a record of several joints.
        fit: The model's fit, percent.
    """
    shares = missing_fit_shares(study, joint, record, fit)
    listed = ", ".join(f"{what} {_list_text((points,))}" for what, points in shares.items())
    return f"{listed}, most of it {max(shares, key=lambda what: shares[what])}"


def missing_fit_shares(study: Comparison, joint: str, record: str, fit: float) -> dict[str, float]:
    """Shares that `shortfall` describes, percentage points; their sum is 100 minus the fit."""
    name = f"{record}-{joint}" if record.startswith("siso") else record
    fits = study.multivariable.references
    if name not in fits[DIAGONAL]:
        fits = reference_fits(study.campaign, (name,), study.multivariable.truth)
    steps = [fit, *(fits[kind][name][joint] for kind in (DIAGONAL, COUPLED, NOISELESS)), 100.0]
    names = ("the model's own error", "coupling", "all that is not linear", "the noise of reading")
    return {what: high - low for what, low, high in zip(names, steps, steps[1:], strict=False)}


def ties(differences: Mapping[str, float]) -> str:
    """In words: which differences of fits are ties; nothing where none is."""
    joints = [name for name, value in differences.items() if tied(value)]
    return f"tied: {'; '.join(name.replace('_', ' ') for name in joints)}" if joints else "nothing is tied"


def _list_text(values: Iterable[float]) -> str:
    return "/".join(f"{round(value, 1) + 0.0:.1f}".replace("-", "−") for value in values)

"""Identification from data files: what `hmtb identify` does, for programs."""

import warnings as python_warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from scenarios.files.data_file import Names, joints_of, read_parts
from scenarios.files.errors import ScenarioError
from scenarios.identification.identification import Identification, identify, usable
from scenarios.identification.order_choice import HELD_OUT, SHORTEST, choose_and_identify, hold_out
from sysid import StructureChoice
from sysid.records.channels import listed
from sysid.records.importers import one_interval


@dataclass(frozen=True, eq=False)
class FileIdentification:
    """A model identified from files.

    Attributes:
        title: Method and files, in words.
        result: The model and how it was judged.
        choice: The choice of method and orders; None where both were given.
        warnings: Remarks on the files, on gaps, bandwidths and numerics.
    """

    title: str
    result: Identification
    choice: StructureChoice | None
    warnings: tuple[str, ...]


def identify_files(
    data: Sequence[Path],
    *,
    method: str | None = None,
    orders: Sequence[int] = (),
    joint: str | None = None,
    input: Names = "u",
    output: Names = "y",
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    steps: int = 1,
    held_out: float | None = None,
    validate: Path | None = None,
    validate_test: str | None = None,
) -> FileIdentification:
    """Identify a model from data files; arguments are the options of `hmtb identify`, which describes them.

    Args:
        data: The record, or several.
        method: One of `ESTIMATORS`; None chooses.
        orders: Orders of the model; none are chosen.
        joint: Joint of a log; the excited one when None.
        input: Names of the input columns of a table.
        output: Names of the output columns.
        dt: Sampling interval of a table without one, s.
        time: Name of the column of times.
        time_unit: Unit of the times.
        test: Which test of a 1553 record.
        missing: Whether outputs may be missing.
        skip: Length of the start that is left out, s.
        keep_mean: Whether to use the values as they are, without an operating point.
        steps: Horizon of a further prediction, samples.
        held_out: Part of the longest record, its end, that judges the model instead of taking part in the estimate;
            a quarter when None and something is chosen, else nothing.
        validate: Another record that judges the model.
        validate_test: Which of its tests.

    Raises:
        ScenarioError: Options that contradict each other, files that cannot be read or used.
        TwinError: Likewise, of our own logs and records.
        SysidError: The estimator refuses the records.
    """
    if not data:
        raise ScenarioError("expected the path of a record; see hmtb identify --help")
    if orders and method is None:
        raise ScenarioError(f"--orders {' '.join(map(str, orders))} given without --method")
    if held_out is not None and validate is not None:
        raise ScenarioError("--held-out and --validate given; expected one: what judges the model")
    share = held_out if held_out is not None else 0.0 if orders or validate is not None else HELD_OUT
    if not 0.0 <= share <= 0.9:
        raise ScenarioError(f"--held-out {share:g} given, expected a part of the record from 0 to 0.9")
    with python_warnings.catch_warnings(record=True) as caught:
        python_warnings.simplefilter("always", UserWarning)
        read = partial(read_parts, input=input, output=output, dt=dt, time=time, time_unit=time_unit, missing=missing)
        parts = one_interval(
            [part for path in data for part in usable(read(path, joint=joint, test=test), skip, path, test)]
        )
        check = None
        if validate is not None:
            # A log is validated on the joint that the model is of, whichever it excites.
            others = read(validate, joint=joints_of(parts[0]) or joint, test=validate_test)
            check = usable(others, skip, validate, validate_test)
        elif share > 0.0:
            parts, check = hold_out(parts, share)
            if held_out is not None and check is None:
                samples = max(map(len, parts))
                raise ScenarioError(
                    f"--held-out {share:g} given for {samples} samples in one piece, expected {SHORTEST} or more"
                )
        if orders and method is not None:
            result, choice = identify(parts, method, orders, keep_mean=keep_mean, steps=steps, check=check), None
        else:
            result, choice = choose_and_identify(parts, method, keep_mean=keep_mean, steps=steps, check=check)
    judged = "" if validate is None else validate.name
    if check and validate is None:
        (last,) = check
        name = next((path.name for path in data if path.stem == last.name), last.name or data[0].name)
        end = last.start + len(last) * last.dt
        judged = f"{name} {last.start:.6g} to {end:.6g} s, held out: the model is not estimated from them"
    title = f"{result.fitted.estimate.method.upper()} from {listed([path.name for path in data])}"
    return FileIdentification(
        title + (f", fits to {judged}" if judged else ""),
        result,
        choice,
        (*(str(one.message) for one in caught), *result.warnings),
    )

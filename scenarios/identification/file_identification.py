"""Identification from data files: what `hmtb identify` does, for programs, and requests of it that can be repeated."""

import inspect
import warnings as python_warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.files.data_file import Names, joints_of, read_parts
from scenarios.files.errors import ScenarioError
from scenarios.files.option_values import option_values
from scenarios.identification.identification import Identification, identify, trend_options, usable
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.order_choice import HELD_OUT, SHORTEST, choose_and_identify, hold_out
from sysid import IOData, StructureChoice
from sysid.polynomial.weighted_output_errors import UNWEIGHTED
from sysid.records.channels import listed
from sysid.records.importers import one_interval
from sysid.validation.structure_scan import Order

NOTHING_HELD_OUT = (
    "nothing is held out, because {}: verdict and fits are on the samples that the model was estimated from; another "
    "record would judge it (--validate)"
)
"""Remark on a record without an end to judge on."""

STEADY_END = (
    "no input moves in the last quarter of the record, an output stays there, or an input moves at other frequencies "
    "than before"
)
"""Reason of it in a record that is long enough."""

SAME_RECORD = (
    "the record that judges the model is one that it was estimated from: its fits say nothing of other records"
)
"""Remark on a record to judge on that was to be another."""


@dataclass(frozen=True, eq=False)
class FileIdentification:
    """A model identified from files.

    Attributes:
        title: Method and files, in words.
        result: The model and how it was judged.
        choice: The choice of method and orders; None where both were given.
        warnings: Remarks on the files, on gaps, bandwidths and numerics.
        held_out: Part of the longest record, its end, that judges the model; 0 where none does.
    """

    title: str
    result: Identification
    choice: StructureChoice | None
    warnings: tuple[str, ...]
    held_out: float = 0.0

    @property
    def chosen_options(self) -> dict[str, object]:
        """Options of `identify_files` that give the chosen model again; empty where nothing was chosen.

        What the choice says against its model, given orders would not say: then it is repeated.
        """
        if self.choice is None or self.choice.cautions:
            return {}
        fitted, trend = self.result.fitted, self.choice.candidates[0].trend_options
        estimator = ESTIMATORS[fitted.estimate.method]
        if not fitted.orders.keys() <= {*estimator.orders, *estimator.optional}:
            # delays of a state-space model, for which there is no option: the choice gives them again
            return {}
        options: dict[str, object] = {"method": fitted.estimate.method, "orders": tuple(fitted.orders.values())}
        options |= {name: True for name in trend}
        # nk says it
        options["direct"] = False
        if fitted.weighting is not None:
            options["weighting"] = fitted.weighting
        if self.held_out and not self.result.is_estimated_again:
            options["held_out"] = self.held_out
        return options

    def record(self) -> dict[str, object]:
        """Return what `hmtb identify --json` prints of the model and of the choice."""
        record: dict[str, object] = {"title": self.title, "method": self.result.fitted.estimate.method}
        record |= self.result.record()
        record |= {"held_out": self.held_out, "estimated_from_all": self.result.is_estimated_again}
        if self.choice is not None:
            best = self.choice.candidates[0]
            candidates = []
            for candidate in self.choice.candidates:
                options: dict[str, object] = dict(candidate.trend_options)
                if any(candidate.weighting):
                    options["weighting"] = candidate.weighting
                criteria = {"bic": candidate.bic - best.bic, "loss": candidate.loss}
                candidates.append({"method": candidate.method, "orders": candidate.orders, **options, **criteria})
            record["choice"] = {"reason": self.choice.reason, "candidates": candidates}
        return record


def identify_files(
    data: Sequence[Path],
    *,
    method: str | None = None,
    orders: Sequence[Order | str] = (),
    joint: Names = (),
    input: Names = "u",
    output: Names = "y",
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    offset: bool = False,
    trend: bool = False,
    direct: bool = False,
    weighting: tuple[int, ...] = (),
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
        joint: Joint of a log, or several, which give one model of all; the excited one when none is named.
        input: Names of the input columns of a table.
        output: Names of the output columns.
        dt: Sampling interval of a table without one, s.
        time: Name of the column of times.
        time_unit: Unit of the times.
        test: Which test of a 1553 record.
        missing: Whether outputs may be missing.
        skip: Length of the start that is left out, s.
        keep_mean: Whether to use the values as they are, without an operating point.
        offset: Whether to fit a constant of the output together with the parameters.
        trend: Whether to fit a straight line likewise.
        direct: Whether a direct term may be chosen although the data have noise.
        weighting: Of oe with orders the degrees nc and nd of a model of the disturbance that weights its errors; none
            where they count alike.
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
    if not isinstance(joint, str) and len(set(joint)) < len(joint):
        raise ScenarioError(f"--joint {' '.join(joint)} given, expected each joint once")
    asked = trend_options(offset=offset, trend=trend, keep_mean=keep_mean)
    if direct and orders:
        raise ScenarioError(f"--direct and --orders {' '.join(map(str, orders))} given; nk = 0 is the direct term")
    degrees = _checked_weighting(weighting, orders)
    share = _held_out_share(orders, held_out, validate)
    # Remarks of the readers belong to the result, for the command line and the page alike.
    with python_warnings.catch_warnings(record=True) as caught:
        python_warnings.simplefilter("always", UserWarning)
        read = partial(read_parts, input=input, output=output, dt=dt, time=time, time_unit=time_unit, missing=missing)
        pieces: list[IOData] = []
        for path in data:
            pieces += _named_apart(usable(read(path, joint=joint or None, test=test), skip, path, test), path, data)
        records = whole = one_interval(pieces)
        check: tuple[IOData, ...] | None = None
        if validate is not None:
            # A log is validated on the joint that the model is of, whichever it excites.
            validation = read(validate, joint=joints_of(records[0]) or joint or None, test=validate_test)
            check = usable(validation, skip, validate, validate_test)
        elif share > 0.0:
            records, check = hold_out(records, share, is_asked_for=held_out is not None)
            if held_out is not None and check is None:
                samples = max(map(len, records))
                raise ScenarioError(
                    f"--held-out {share:g} given for {samples} samples in one piece, expected {SHORTEST} or more with "
                    "an input and outputs that move at the end"
                )
        is_held_out = validate is None and check is not None
        choice: StructureChoice | None = None
        # Without orders, the method alone limits the choice.
        if orders and method is not None:
            result = identify(
                records,
                method,
                orders,
                keep_mean=keep_mean,
                trend=asked,
                weighting=degrees,
                steps=steps,
                check=check,
                continued=validate is None,
            )
        else:
            result, choice = choose_and_identify(
                records,
                method,
                keep_mean=keep_mean,
                offset=True if offset else None,
                trend=True if trend else None,
                direct=direct,
                steps=steps,
                check=check,
                continued=validate is None,
                # a part that was asked for explicitly has no influence on the model
                whole=whole if is_held_out and held_out is None else None,
            )
    title = f"{result.fitted.estimate.method.upper()} from {listed([path.name for path in data])}"
    if validate is not None:
        title += f", fits to {validate.name}"
    elif check:
        title += f", fits to {_held_out_in_words(check[0], data, is_estimated_again=result.is_estimated_again)}"
    messages = tuple(str(warning.message) for warning in caught)
    if validate is not None and any(_are_equal(one, other) for one in check or () for other in records):
        messages = (*messages, SAME_RECORD)
    if check is None and share > 0.0:
        longest = max(map(len, records))
        short = f"the longest piece has {longest} samples of the {SHORTEST} that are expected"
        messages = (*messages, NOTHING_HELD_OUT.format(short if longest < SHORTEST else STEADY_END))
    return FileIdentification(
        title, result, choice, (*messages, *result.warnings), held_out=share if is_held_out else 0.0
    )


def _named_apart(records: Sequence[IOData], path: Path, data: Sequence[Path]) -> list[IOData]:
    """Records of a file, named by its folder too where another file has its name: equal names would make one run."""
    same_names = [other for other in data if other.stem == path.stem]
    if len(same_names) < 2:
        return list(records)
    return [replace(record, name=f"{path.parent}/{record.name}") for record in records]


def _checked_weighting(weighting: Sequence[int], orders: Sequence[Order | str]) -> tuple[int, int]:
    """Degrees of C and D of the model of the disturbance that weights the errors; zeros without one."""
    if not weighting:
        return UNWEIGHTED
    shown = " ".join(map(str, weighting))
    if not orders:
        raise ScenarioError(f"--weighting {shown} given without --orders; it is chosen with them")
    if len(weighting) != 2:
        raise ScenarioError(f"--weighting {shown} given, expected two degrees NC ND of a model C/D of the disturbance")
    nc, nd = weighting
    return nc, nd


def _are_equal(one: IOData, other: IOData) -> bool:
    """Whether two records have the same samples."""
    return np.array_equal(one.u, other.u) and np.array_equal(one.y, other.y, equal_nan=True)


def _held_out_share(orders: Sequence[Order | str], held_out: float | None, validate: Path | None) -> float:
    """Part of the longest record that judges the model: by default one only where orders are chosen."""
    if held_out is not None:
        share = held_out
    elif orders or validate is not None:
        share = 0.0
    else:
        share = HELD_OUT
    if not 0.0 <= share <= 0.9:
        raise ScenarioError(f"--held-out {share:g} given, expected a part of the record from 0 to 0.9")
    return share


def _held_out_in_words(held_out: IOData, data: Sequence[Path], *, is_estimated_again: bool) -> str:
    """Which part judges the model, and whether the model was estimated from it afterwards."""
    names = [path.name for path in data if held_out.name in (path.stem, f"{path.parent}/{path.stem}")]
    name = names[0] if names else held_out.name or data[0].name
    start, end = held_out.start + held_out.window * held_out.dt, held_out.start + len(held_out) * held_out.dt
    part = f"{name} {start:.6g} to {end:.6g} s, held out"
    if is_estimated_again:
        return f"{part}; parameters, gain and bandwidth are then estimated from all samples"
    return f"{part}: the model is not estimated from them"


IMPORTS = "from pathlib import Path\nfrom scenarios.identification.file_identification import identify_files\n"
"""Lines before the call in Python."""

_PARAMETERS = inspect.signature(identify_files).parameters.values()
DEFAULTS = {parameter.name: parameter.default for parameter in _PARAMETERS if parameter.kind is parameter.KEYWORD_ONLY}
DEFAULTS |= {"joint": (), "input": ("u",), "output": ("y",)}  # as the command line has them, which takes several names
"""Options of `identify_files`, in their sequence, with their values where they are not given."""


@dataclass(frozen=True)
class IdentificationRequest:
    """Files and options of one identification.

    Attributes:
        data: The files.
        options: Options of `identify_files`; those that are left at their defaults are dropped.
    """

    data: tuple[Path, ...]
    options: Mapping[str, Any]

    def __post_init__(self) -> None:
        options = {name: self.options.get(name, default) for name, default in DEFAULTS.items()}
        changed = {name: value for name, value in options.items() if value != DEFAULTS[name]}
        object.__setattr__(self, "options", changed)

    def run(self) -> FileIdentification:
        """Identify; raises what `identify_files` raises."""
        return identify_files(self.data, **self.options)

    @property
    def words(self) -> tuple[str, ...]:
        """The command."""
        words = ["hmtb", "identify", *map(str, self.data)]
        for name, value in self.options.items():
            words.append(f"--{name.replace('_', '-')}")
            words += option_values(value)
        return tuple(words)

    @property
    def python(self) -> str:
        """The call of `identify_files`; see `IMPORTS`."""
        arguments = [f"[{', '.join(map(_literal, self.data))}]"]
        arguments += [f"{name}={_literal(value)}" for name, value in self.options.items()]
        return f"identify_files({', '.join(arguments)})"


def _literal(value: object) -> str:
    return f"Path({str(value)!r})" if isinstance(value, Path) else repr(value)

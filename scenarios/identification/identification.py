"""From records to a model and what may be said of it: the work of `hmtb identify`."""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import sysid
from scenarios.experiments.joint_inputs import dependence_warning
from scenarios.files.data_file import excited
from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import ESTIMATORS, SHORTEST, estimate
from sysid import Estimate, IOData, ModelFit, ResidualTest, SysidError
from sysid.models.bandwidth import BandwidthClaim, bandwidth_claim
from sysid.polynomial.fit_with_offset import OffsetFit, fit_with_offset, subtract_means, unexplained_offset


@dataclass(frozen=True)
class Identification:
    """A model from a record, and how well it holds.

    Attributes:
        estimate: The model.
        orders: All its orders by name.
        parts: What it was estimated from.
        checked: What it was judged on: the same, or records of their own.
        level: Inputs and outputs of the operating point; None where the means were left in.
        fit: Fits to `checked`.
        test: Residual test on `checked`; None where it cannot be made.
        untested: Why not.
        claims: Bandwidth of every path (ny, nu).
        warnings: What the estimator, the gaps and the bandwidths call for.
    """

    estimate: Estimate
    orders: dict[str, int]
    parts: tuple[IOData, ...]
    checked: tuple[IOData, ...]
    level: tuple[np.ndarray, np.ndarray] | None
    fit: ModelFit
    test: ResidualTest | None
    untested: str
    claims: tuple[tuple[BandwidthClaim, ...], ...]
    warnings: tuple[str, ...]

    @property
    def samples(self) -> int:
        """Samples that the model is of."""
        return sum(map(len, self.parts))


def identified(
    parts: Sequence[IOData],
    method: str,
    orders: Sequence[int],
    *,
    keep_mean: bool = False,
    steps: int = 1,
    check: Sequence[IOData] | None = None,
) -> Identification:
    """Estimate a model with its operating point, and judge it.

    Args:
        parts: What to estimate from, as `usable` returns it.
        method: One of `ESTIMATORS`.
        orders: Its orders.
        keep_mean: Whether the model is of the values as they are, without an operating point.
        steps: Horizon of the further prediction, samples.
        check: Other records to judge on; the same when None.

    Returns:
        The model and what is to be said of it.

    Raises:
        ScenarioError: Unknown method, wrong orders, several outputs for a method that takes one.
        SysidError: What the estimator refuses.
    """
    complete: dict[str, int] = {}

    def run(records: Sequence[IOData]) -> Estimate:
        found, asked = estimate(records[0] if len(records) == 1 else records, method, orders)
        complete.update(asked)
        return found

    first = parts[0]
    if method in ESTIMATORS and first.ny > 1 and not ESTIMATORS[method].outputs:
        several = ", ".join(name for name, entry in ESTIMATORS.items() if entry.outputs)
        raise ScenarioError(f"{method} takes one output, given {first.ny}; for several there are: {several}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        if keep_mean:
            found, level, of = run(tuple(parts)), None, tuple(parts)
        else:
            result: OffsetFit = fit_with_offset(run, parts)
            found, level, of = result.estimate, (result.input, result.output), result.parts
        checked = _about_its_own_level(found, check or parts, keep_mean)
        (fit,) = sysid.compare({method: found}, checked, steps=steps)
        test, untested = _tested(found, checked)
        band, longest = found.bandwidth(), max(of, key=len)
        claims = tuple(
            tuple(bandwidth_claim(found, longest, output=i, input=j, band=band) for j in range(first.nu))
            for i in range(first.ny)
        )
    return Identification(
        found, complete, of, checked, level, fit, test, untested, claims, tuple(_texts(found, of, claims))
    )


def usable(
    records: Sequence[IOData], skip: float, method: str, path: Path, test: str | None = None
) -> tuple[IOData, ...]:
    """Leave out the start, and cut records at their gaps where the method cannot do with them.

    Args:
        records: As read.
        skip: How much of the start is left out, s.
        method: Name of the estimator.
        path: Where the records come from, for messages.
        test: Which test of the file, likewise.

    Returns:
        The records.

    Raises:
        ScenarioError: Nothing or too little is left, or a channel is constant.
    """
    dt, samples = records[0].dt, sum(map(len, records))
    if not 0 <= skip < (samples - 1) * dt:
        raise ScenarioError(
            f"{path.name}: skip must be 0 to less than the record's {samples * dt:g} s, given {skip:g} s"
        )
    left, kept = round(skip / dt), []
    for part in records:
        kept += [part[left:]] if len(part) > left else []
        left = max(left - len(part), 0)
    _refuse_constants(kept, path, test)
    if len(kept) == 1 and kept[0].complete:
        return (kept[0],)
    cut = method in ESTIMATORS and not ESTIMATORS[method].gaps
    whole: list[IOData] = []
    for part in kept:
        try:
            whole += part.complete_parts(shortest=SHORTEST) if cut else [part]
        except SysidError:
            continue
    whole = [part for part in whole if part.known.all(axis=1).sum() >= SHORTEST]
    if not whole:
        raise ScenarioError(f"{path.name}: between the gaps no part has {SHORTEST} samples; nothing to identify from")
    return tuple(whole)


def _refuse_constants(records: Sequence[IOData], path: Path, test: str | None) -> None:
    # Seen before the mean is removed, which would leave rounding where there was a constant.
    u, y = (np.concatenate([getattr(part, channel) for part in records]) for channel in "uy")
    for what, values, names in (("input", u, records[0].input_names), ("output", y, records[0].output_names)):
        for column, name in zip(values.T, names or (), strict=True):
            if np.nanmin(column) == np.nanmax(column):
                axes = excited(path, test)
                hint = f"; {path.name} excites {', '.join(axes)}, expected a log of the same joint" if axes else ""
                raise ScenarioError(
                    f"{path.name}: the {what} {name!r} is constant at {np.nanmin(column):g}; expected one "
                    f"that moves in {len(u)} samples{hint}"
                )


def _about_its_own_level(found: Estimate, check: Sequence[IOData], keep_mean: bool) -> tuple[IOData, ...]:
    """Records to judge on about their own operating point, which the model's dynamics tell."""
    if keep_mean:
        return tuple(check)
    moved, _, _ = subtract_means(check)
    level, _, _ = unexplained_offset(found.model, moved)
    return tuple(part.subtract(y=level) for part in moved)


def _tested(found: Estimate, checked: Sequence[IOData]) -> tuple[ResidualTest | None, str]:
    whole: list[IOData] = []
    for part in checked:
        try:
            whole += part.complete_parts(shortest=SHORTEST if not part.complete else 1)
        except SysidError:
            continue
    if not whole:
        return None, f"no part without missing samples has {SHORTEST}"
    try:
        return sysid.resid(found, whole), ""
    except SysidError as error:
        return None, str(error)


def _texts(found: Estimate, parts: Sequence[IOData], claims: Sequence[Sequence[BandwidthClaim]]) -> list[str]:
    lost = sum(int((~part.known).sum()) for part in parts)
    values, samples = sum(part.y.size for part in parts), sum(map(len, parts))
    texts = []
    if len(parts) > 1:
        texts.append(f"the model and the fits are of {len(parts)} parts between lost samples, {samples} samples in all")
    if lost:
        texts.append(f"{lost} of {values} output samples are missing")
    first, paths = parts[0], dict[str, list[str]]()
    for i, row in enumerate(claims):
        for j, one in enumerate(row):
            path = f"{(first.input_names or ())[j]} → {(first.output_names or ())[i]}"
            for text in one.warnings:
                paths.setdefault(text, []).append(path)
    if first.nu > 1 and (together := dependence_warning(max(parts, key=len))):
        texts.append(together)
    every = first.nu * first.ny
    # What is true of all paths is said once.
    texts += [text if len(of) == every else f"{', '.join(of)}: {text}" for text, of in paths.items()]
    return [*texts, *(_for_users(text) for text in found.diagnostics.get("warnings", ()))]


def _for_users(text: str) -> str:
    """A warning of the analyst's without advice in words of Python, which the command line has no use for."""
    return "; ".join(part for part in text.split("; ") if not re.search(r"\b\w+=(True|False)\b", part)) or text

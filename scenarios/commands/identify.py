"""`hmtb identify`: any estimator on any record, also from one's own robot."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import print_json, print_table, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sysid import IOData


def identify(
    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")],
    /,
    *,
    method: Annotated[str, tyro.conf.arg(metavar="arx|armax|oe|okid")],
    orders: tuple[int, ...],
    joint: str | None = None,
    input: str = "u",
    output: str = "y",
    dt: float | None = None,
    test: str | None = None,
    skip: float = 0.0,
    keep_mean: bool = False,
    validate: Path | None = None,
    validate_test: str | None = None,
    json: bool = False,
) -> int:
    """Identify one input and one output from a record, ours or any robot's.

    Methods and their orders: arx na nb [nk], armax na nb nc [nk], oe nb nf [nk], okid order [p]. nk = 1 (the default)
    means that y(t) depends on u(t-1) first; p = 5 (the default) is the number of observer Markov parameters.

    Reads the logs and records of hmtb simulate and hmtb convert (.nc, .csv, .mat, .asc, .ch10), and anyone's .csv (a
    header, or two bare columns u, y), .txt (likewise) and .mat (variables u, y). Samples that the bus lost are left
    out: the model is of all parts between them, the fits are to the longest.

    hmtb identify robot.csv --input command --output angle --method oe --orders 2 2 1

    Args:
        data: The record.
        method: arx, armax, oe or okid.
        orders: Orders of the model, in the field's usual sequence.
        joint: Which joint of a log; the excited one when not given.
        input: Name of the input column of a CSV or .mat file.
        output: Name of the output column of a CSV or .mat file.
        dt: Sampling interval of a CSV or .mat file that says none, s. A column t, time or Time (s), or a variable dt
            or Ts, says it.
        test: Which test of a 1553 record, by name or number.
        skip: Leave out this much of the start, s. Worth it where the record starts from rest: a start that is still
            settling leaves different means in input and output.
        keep_mean: Leave the means in; otherwise they are removed.
        validate: Another record; the fits are then to it.
        validate_test: Which of its tests, by name or number.
        json: Print JSON.
    """
    import warnings

    import numpy as np

    import sysid
    from scenarios.commands.bandwidth import claim
    from scenarios.datafile import of_joint, read_parts
    from scenarios.estimators import estimate

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", UserWarning)
        read = read_parts(data, joint=joint, input=input, output=output, dt=dt, test=test)
        parts = _prepare(read, skip, keep_mean, data, test)
        record = max(parts, key=len)
        other = record
        if validate is not None:
            # A log is validated on the joint that the model is of, whichever it excites.
            same = of_joint(record) or joint
            others = read_parts(validate, joint=same, input=input, output=output, dt=dt, test=validate_test)
            other = max(_prepare(others, skip, keep_mean, validate, validate_test), key=len)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        found, complete = estimate(parts if len(parts) > 1 else record, method, orders)
        (fit,) = sysid.compare(found, other)
        band = claim(found, record)
    hz, low, high = band.hz, band.low, band.high
    poles = found.model.poles()
    samples = sum(map(len, parts))
    gaps = (
        f"the model is of {len(parts)} parts between lost samples, {samples} samples in all; the fits are to the "
        f"longest part, {len(record)} samples"
    )
    texts = [
        *(str(one.message) for one in said),
        *([gaps] if len(parts) > 1 else []),
        *band.warnings,
        *found.diagnostics.get("warnings", ()),
    ]
    gain = float(found.model.dc_gain()[0, 0])
    if json:
        print_json(
            {
                "method": method,
                "orders": complete,
                "fit": {"simulation": fit.simulation, "one_step": fit.one_step},
                "bandwidth_hz": hz,
                "ci95": [low, high],
                "poles": poles,
                "zeros": found.model.zeros(),
                "dc_gain": gain,
                "samples": samples,
                "dt": record.dt,
                "warnings": texts,
            }
        )
        return 0
    shown = ", ".join(f"{pole.real:.4f}" + (f"{pole.imag:+.4f}j" if abs(pole.imag) > 1e-9 else "") for pole in poles)
    if np.isfinite(hz):
        interval = f"{hz:.4g} Hz, 95 % interval {low:.4g} to {high:.4g} Hz"
    else:
        interval = "—" if band.refused else "none below Nyquist"
    rows = [
        ("orders", ", ".join(f"{name} {value}" for name, value in complete.items())),
        ("record", f"{samples} samples every {record.dt:g} s"),
        ("fit in simulation", f"{fit.simulation[0]:.2f} %"),
        ("fit one step ahead", f"{fit.one_step[0]:.2f} %"),
        ("bandwidth (-3 dB)", interval),
        ("gain at 0 Hz", f"{gain:.4f}" if abs(gain) < 1e9 else "none, it integrates"),
        ("poles (z plane)", shown),
    ]
    print_table(
        f"{method.upper()} from {data.name}" + (f", fits to {validate.name}" if validate else ""), ("", ""), rows
    )
    for text in texts:
        say(f"warning: {text}")
    return 0


SHORTEST = 100
"""Parts with fewer samples between two gaps are left out: the past of a model would take most of them."""


def _prepare(
    records: "Sequence[IOData]", skip: float, keep_mean: bool, path: Path, test: str | None = None
) -> "tuple[IOData, ...]":
    """Leave out the start and the means, and cut the record at its gaps."""
    import numpy as np

    from scenarios.datafile import excited
    from scenarios.errors import ScenarioError
    from sysid import SysidError

    dt, samples = records[0].dt, sum(map(len, records))
    if not 0 <= skip < (samples - 1) * dt:
        raise ScenarioError(
            f"{path.name}: skip must be 0 to less than the record's {samples * dt:g} s, given {skip:g} s"
        )
    left, kept = round(skip / dt), []
    for part in records:
        kept += [part[left:]] if len(part) > left else []
        left = max(left - len(part), 0)
    u, y = (np.concatenate([getattr(part, channel) for part in kept]) for channel in "uy")
    # Seen before the mean is removed, which would leave rounding where there was a constant.
    for what, values, names in (("input", u, kept[0].input_names), ("output", y, kept[0].output_names)):
        if np.nanmin(values) == np.nanmax(values):
            axes = excited(path, test)
            hint = f"; {path.name} excites {', '.join(axes)}, expected a log of the same joint" if axes else ""
            raise ScenarioError(
                f"{path.name}: the {what} {(names or ('',))[0]!r} is constant at {np.nanmin(values):g}; expected one "
                f"that moves in {len(u)} samples{hint}"
            )
    if len(kept) == 1 and kept[0].complete:
        return (kept[0] if keep_mean else kept[0].detrend(),)
    if not keep_mean:  # one mean for all parts: each has one of its own only by chance
        kept = [part.subtract(u=u.mean(axis=0), y=np.nanmean(y, axis=0)) for part in kept]
    whole: list[IOData] = []
    for part in kept:
        try:
            whole += part.complete_parts(shortest=SHORTEST)
        except SysidError:
            continue
    whole = [part for part in whole if len(part) >= SHORTEST]
    if not whole:
        raise ScenarioError(f"{path.name}: between the gaps no part has {SHORTEST} samples; nothing to identify from")
    return tuple(whole)

"""`hmtb identify`: any estimator on any record, also from one's own robot."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import print_json, print_table, say

if TYPE_CHECKING:
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
    skip: float = 0.0,
    keep_mean: bool = False,
    validate: Path | None = None,
    json: bool = False,
) -> int:
    """Identify one input and one output from a record, ours or any robot's.

    Methods and their orders: arx na nb [nk], armax na nb nc [nk], oe nb nf [nk], okid order [p]. nk = 1 (the default)
    means that y(t) depends on u(t-1) first; p = 5 (the default) is the number of observer Markov parameters.

    Reads .nc logs of hmtb simulate, .csv (a header, or two bare columns u, y) and .mat (variables u, y).

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
        skip: Leave out this much of the start, s. Worth it where the record starts from rest: a start that is still
            settling leaves different means in input and output.
        keep_mean: Leave the means in; otherwise they are removed.
        validate: Another record; the fits are then to it.
        json: Print JSON.
    """
    import warnings

    import numpy as np

    import sysid
    from scenarios.commands.bandwidth import claim
    from scenarios.datafile import read_data
    from scenarios.estimators import estimate

    record = _prepare(read_data(data, joint=joint, input=input, output=output, dt=dt), skip, keep_mean, data)
    other = record
    if validate is not None:
        # A log is validated on the joint that the model is of, whichever it excites.
        same = (record.input_names or ("",))[0].removesuffix(" commanded") if data.suffix == ".nc" else joint
        other = read_data(validate, joint=same, input=input, output=output, dt=dt)
        other = _prepare(other, skip, keep_mean, validate)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        found, complete = estimate(record, method, orders)
        (fit,) = sysid.compare(found, other)
        band = claim(found, record)
    hz, low, high = band.hz, band.low, band.high
    poles = found.model.poles()
    texts = [*band.warnings, *found.diagnostics.get("warnings", ())]
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
                "samples": len(record),
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
        ("record", f"{len(record)} samples every {record.dt:g} s"),
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


def _prepare(record: "IOData", skip: float, keep_mean: bool, path: Path) -> "IOData":
    from scenarios.datafile import excited
    from scenarios.errors import ScenarioError

    if not 0 <= skip < (len(record) - 1) * record.dt:
        raise ScenarioError(
            f"{path.name}: skip must be 0 to less than the record's {len(record) * record.dt:g} s, given {skip:g} s"
        )
    part = record[round(skip / record.dt) :]
    # Seen before the mean is removed, which would leave rounding where there was a constant.
    for what, values, names in (("input", part.u, part.input_names), ("output", part.y, part.output_names)):
        if values.min() == values.max():
            joints = excited(path)
            hint = f"; {path.name} excites {', '.join(joints)}, expected a log of the same joint" if joints else ""
            raise ScenarioError(
                f"{path.name}: the {what} {(names or ('',))[0]!r} is constant at {values[0, 0]:g}; expected one that "
                f"moves in {len(part)} samples{hint}"
            )
    return part if keep_mean else part.detrend()

"""`hmtb compare`: models of any origin against a record and against the truth."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say

if TYPE_CHECKING:
    from scenarios.identification.model_comparison import ComparedModels, JudgedModel
    from sysid import IOData

FIGURES = (".svg", ".png", ".pdf")
"""Endings of figures."""

DRAWN = 5.0
"""Length of the piece that is drawn when none is named, s."""


def compare(
    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")],
    /,
    *,
    models: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODEL...")] = ("truth", "published"),
    estimation: Annotated[Path | None, tyro.conf.arg(metavar="DATA")] = None,
    joint: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")] = (),
    input: tuple[str, ...] = ("u",),
    output: tuple[str, ...] = ("y",),
    dt: float | None = None,
    test: str | None = None,
    estimation_test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    steps: int = 1,
    piece: Annotated[tuple[float, float] | None, tyro.conf.arg(metavar="START LENGTH")] = None,
    out: Annotated[Path | None, tyro.conf.arg(metavar="FIGURE")] = None,
    json: bool = False,
) -> int:
    """Lay models beside a record: how well each simulates and predicts it, and its bandwidth.

    Models are named by where they come from:

      truth            the small-signal truth of the twin's arm, where the record is a log of hmtb simulate
      published        every model that the thesis prints of the joint
      published:4.7    one of them by its equation: 4.7 to 4.13, 5.8 to 5.10, 4.7+4.9
      published:okid   a model of three joints (sysid, okid, hybrid), or its part for the joint at hand
      oe:2/2/1         an estimator with its orders, as hmtb identify takes them, identified from --estimation

    Fits are 100 (1 - |y - yhat| / |y - mean y|): 100 is perfect, 0 no better than the mean. In simulation a model sees
    commands alone; one step ahead it sees all measurements before, if it has a noise model; one without (OE) predicts
    no better than it simulates. Compare like with like. A model fits the record that it was identified from better
    than any other: without --estimation that is what you see. Every model is judged about its own operating point,
    with its initial state fitted, as hmtb identify does; files are read as there.

      hmtb compare siso-8-elbow_pitch.nc --estimation siso-5-elbow_pitch.nc --models truth published oe:2/2/2 okid:2
      hmtb compare rpcm.nc --joint shoulder_yaw shoulder_pitch elbow_pitch --models published:sysid published:okid
      hmtb compare robot.csv --input command --output angle --models arx:2/2 n4sid:3 --out outputs.svg

    Args:
        data: The record that models are judged on.
        models: The models; truth and published when not given.
        estimation: Another record, read alike, that estimators identify from; the same record when not given.
        joint: Which joint of a log, or several of one; the excited one when not given.
        input: Names of the input columns of a table, or variables of a .mat or .nc file.
        output: Names of the output columns, likewise.
        dt: Sampling interval of a table that says none, s.
        test: Which test of a 1553 record, by name or number.
        estimation_test: Which test of the record to identify from, likewise.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete.
        skip: Leave out this much of the start of every record, s.
        keep_mean: Take the values as they are, without an operating point.
        steps: Horizon of a further prediction, samples.
        piece: Start and length of the piece that is drawn, s; 5 s from the middle when not given.
        out: One figure of the outputs and errors (.svg, .png or .pdf).
        json: Print JSON.
    """
    import warnings

    from scenarios.files.atomic_write import check_place
    from scenarios.files.errors import ScenarioError
    from scenarios.identification.model_comparison import compare_models, parsed, same_samples

    wanted = [parsed(text) for text in dict.fromkeys(models)]
    if not wanted:
        raise ScenarioError("no model named; expected one or more after --models")
    if out is not None:
        if out.suffix not in FIGURES:
            raise ScenarioError(f"--out {out} given, expected a figure: {', '.join(FIGURES)}")
        check_place(out)
    elif piece is not None:
        raise ScenarioError("--piece given without --out: it is the piece of the record that a figure shows")
    estimates = [one for one in wanted if one.kind not in ("truth", "published")]
    if estimation is not None and not estimates:
        raise ScenarioError("--estimation given, but no model that is identified; name one, as oe:2/2/1")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", UserWarning)
        options = {"input": input, "output": output, "dt": dt, "missing": missing}
        records = _read(data, joint, test, options)
        others = None if estimation is None else _read(estimation, joint or _same(records), estimation_test, options)
        found = compare_models(
            wanted,
            records,
            data,
            estimation=others,
            estimation_path=estimation,
            skip=skip,
            keep_mean=keep_mean,
            steps=steps,
            test=test,
        )
    texts = [str(one.message) for one in said]
    if estimates and (others is None or same_samples(records, others)):
        shown = ", ".join(one.text for one in estimates)
        where = f"{data.name} itself" if estimation is None else f"{estimation.name}, which holds the same record"
        texts.append(f"{shown}: identified from {where}, so that the fit is no validation (--estimation)")
    if out is not None:
        _draw(found, data, out, piece)
    if json:
        print_json(_record(found, data, estimation, texts, out, estimates=bool(estimates)))
        return 0
    _print(found, data, estimation if estimates else None, texts)
    if out is not None:
        say(f"figure: {out}")
    return 0


def _read(path: Path, joints: Sequence[str], test: str | None, options: Mapping[str, object]) -> "tuple[IOData, ...]":
    """The record, of one joint as every command reads it, or of several."""
    from scenarios.files.data_file import read_parts
    from scenarios.files.errors import ScenarioError
    from scenarios.identification.model_comparison import read_joints

    if len(joints) < 2:
        return read_parts(path, joint=joints[0] if joints else None, test=test, **options)  # type: ignore[arg-type]
    if (options["input"], options["output"]) != (("u",), ("y",)):
        raise ScenarioError("--joint names joints of our own records; --input and --output are for tables")
    return read_joints(path, joints, dt=options["dt"], test=test, missing=bool(options["missing"]))  # type: ignore[arg-type]


def _same(records: "Sequence[IOData]") -> tuple[str, ...]:
    """The joints of the record: the other is read for the same ones, whichever it excites."""
    from scenarios.files.data_file import joints_of

    return joints_of(records[0])


def _record(
    found: "ComparedModels",
    data: Path,
    estimation: Path | None,
    texts: Sequence[str],
    out: Path | None,
    *,
    estimates: bool,
) -> dict[str, object]:
    first = found.parts[0]
    return {
        "data": data,
        "estimation": (estimation or data) if estimates else None,
        "inputs": first.input_names,
        "outputs": first.output_names,
        "samples": sum(map(len, found.parts)),
        "dt": first.dt,
        "models": [_model(entry) for entry in found.models],
        "warnings": texts,
        "figure": out,
    }


def _model(entry: "JudgedModel") -> dict[str, object]:
    """A model as JSON; of a single path bandwidth and gain are numbers, else rows of outputs."""
    gain, single = entry.model.dc_gain(), entry.model.nu == entry.model.ny == 1
    return {
        "model": entry.label,
        "kind": entry.kind,
        "fit": {
            "simulation": entry.fit.simulation,
            "one_step": entry.fit.one_step,
            "steps": entry.fit.steps,
            "ahead": entry.fit.ahead,
        },
        "bandwidth_hz": entry.bandwidth_hz[0, 0] if single else entry.bandwidth_hz,
        "ci95": entry.ci95[0, 0] if single else entry.ci95,
        "dc_gain": gain[0, 0] if single else gain,
        "half_power_hz": _half_power(entry)[0] if single else _half_power(entry),
        "poles": entry.model.input_path().poles(),
        "stable": entry.model.is_stable(),
        "operating_point": entry.level,
        "remarks": entry.remarks,
    }


def _half_power(entry: "JudgedModel") -> list[float]:
    """Frequency of the gain 0.707 from each input to its own output; NaN where the gain starts below it."""
    import numpy as np

    from sysid import FrequencyResponse
    from sysid.models.bandwidth import gain_crossing

    f = np.geomspace(1e-4, 0.5, 4000) / entry.model.dt
    response = entry.model.frequency_response(f)
    return [
        gain_crossing(FrequencyResponse(f, response[:, k : k + 1, k : k + 1], entry.model.dt, "model"), np.sqrt(0.5))
        for k in range(min(entry.model.ny, entry.model.nu))
    ]


def _print(found: "ComparedModels", data: Path, estimation: Path | None, texts: Sequence[str]) -> None:
    import numpy as np

    first, steps = found.parts[0], found.models[0].fit.steps
    outputs = first.output_names or ()
    rows = []
    for entry in found.models:
        gain = entry.model.dc_gain()
        for i, name in enumerate(outputs):
            k = min(i, entry.model.nu - 1)
            hz, (low, high) = entry.bandwidth_hz[i, k], entry.ci95[i, k]
            rows.append(
                (
                    entry.label if i == 0 else "",
                    *((name,) if len(outputs) > 1 else ()),
                    f"{entry.fit.simulation[i]:.2f}",
                    f"{entry.fit.one_step[i]:.2f}",
                    *((f"{entry.fit.ahead[i]:.2f}",) if steps > 1 else ()),
                    f"{hz:.3f}" if np.isfinite(hz) else "—",
                    f"{low:.3f} to {high:.3f}" if np.isfinite(low) else "",
                    f"{gain[i, k]:.3f}" if abs(gain[i, k]) < 1e9 else "—",
                    "yes" if entry.model.is_stable() else "NO",
                )
            )
    title = f"Models on {data.name}, {sum(map(len, found.parts))} samples every {first.dt:g} s"
    columns = (
        "model",
        *(("output",) if len(outputs) > 1 else ()),
        "simulation %",
        "one step %",
        *((f"{steps} steps %",) if steps > 1 else ()),
        "bandwidth Hz",
        "95 % interval",
        "gain at 0 Hz",
        "stable",
    )
    print_table(title, columns, rows)
    if estimation is not None:
        say(f"identified from: {estimation}")
    said: dict[str, list[str]] = {}
    for entry in found.models:
        for text in entry.remarks:
            said.setdefault(text, []).append(entry.label)
    for text, labels in said.items():
        # Remarks on prints name their equation themselves.
        say(f"note: {text}" if labels[0].startswith("published") else f"{', '.join(labels)}: {text}")
    for text in texts:
        say(f"warning: {text}")


def _draw(found: "ComparedModels", data: Path, out: Path, piece: tuple[float, float] | None) -> None:
    import matplotlib

    from scenarios.files.errors import ScenarioError
    from scenarios.report.figures import SETTINGS, save_figure
    from sysid.plots import PALETTE, Trace, output_comparison

    longest = max(range(len(found.parts)), key=lambda k: len(found.parts[k]))
    record = found.parts[longest]
    whole = len(record) * record.dt
    start, length = piece or (max(0.5 * (whole - DRAWN), 0.0), min(DRAWN, whole))
    if not (0.0 <= start < whole and length > 0.0):
        raise ScenarioError(f"--piece {start:g} {length:g} given, expected a start from 0 to below {whole:g} s")
    # Each kind looks as it does everywhere; further ones of a kind take what no kind here has.
    own = {entry.kind: PALETTE[entry.kind] for entry in found.models}
    free = [look for name, look in PALETTE.items() if name not in (*own, "measured", "etfe", "truth")]
    traces = []
    for entry in found.models:
        fit = entry.fit.by_experiment[longest] if entry.fit.by_experiment else entry.fit
        style = own.pop(entry.kind, None) or (free.pop(0) if free else PALETTE[entry.kind])
        percents = ", ".join(f"{value:.1f}" for value in fit.simulation)
        traces.append(Trace(f"{entry.label}: fit {percents} %", fit.simulated + entry.level, style))
    radians = all(unit == "rad" for unit in record.output_units or ("",))
    with output_folder(out.parent), matplotlib.rc_context(SETTINGS):
        figure = output_comparison(
            record,
            traces,
            start=start,
            length=length,
            scale=1000.0 if radians else 1.0,
            unit="mrad" if radians else None,
        )
        figure.axes[0].set_title(f"{data.name}: simulated outputs", loc="left", fontsize=10)
        save_figure(figure, out, dpi=150)

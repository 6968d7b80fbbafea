"""`hmtb compare`: models of any origin on a record, beside the truth."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import check_figure, draw, print_json, print_table, say, say_each, say_next
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from scenarios.identification.model_comparison import JudgedModel
    from sysid import IOData

DRAWN = 5.0
"""Length of the drawn piece without --piece, s."""


def compare(
    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")],
    *,
    models: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODEL...")] = ("truth", "published"),
    estimation: Annotated[Path | None, tyro.conf.arg(metavar="DATA")] = None,
    joint: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")] = (),
    input: tuple[str, ...] = ("u",),
    output: tuple[str, ...] = ("y",),
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    estimation_test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    steps: int = 1,
    piece: Annotated[tuple[float, float] | None, tyro.conf.arg(metavar="START LENGTH")] = None,
    out: Annotated[Path | None, tyro.conf.arg(metavar="FIGURE")] = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Compare models with a record: fits and bandwidths.

    Name models by their origin:

      truth            the small-signal truth of the twin's arm; the record is then a log of hmtb simulate
      published        the published models: all that the thesis prints for the joint
      published:4.7    one of them by its equation: 4.7 to 4.13, 5.8 to 5.10, 4.7+4.9
      published:okid   a published model of three joints: sysid, okid or hybrid; on one joint, its part for it
      oe:2/2/1         an estimator with its orders, as for hmtb identify, identified from --estimation
      my-model.json    a model file, as hmtb identify --save writes it

    Fits are 100 (1 - |y - yhat| / |y - mean y|): 100 is perfect, 0 no better than the mean. A simulation uses only the
    commands. A prediction one step ahead also uses all earlier measurements, if the model describes the noise; one that
    does not (OE) predicts no better than it simulates. Without --estimation, models are fitted to the record itself,
    which they then fit better than any other. Every model is judged about its own operating point, with its initial
    state fitted. Files are read as by hmtb identify.

      hmtb compare siso-8-elbow_pitch.nc --estimation siso-5-elbow_pitch.nc --models truth published oe:2/2/2 okid:2
      hmtb compare rpcm.nc --joint shoulder_yaw shoulder_pitch elbow_pitch --models published:sysid published:okid
      hmtb compare robot.csv --input command --output angle --models arx:2/2 n4sid:3 --out outputs.svg

    Args:
        data: The record on which models are judged.
        models: The models; truth and published when not given.
        estimation: Record from which models are identified, read in the same way; DATA itself when not given.
        joint: Which joint of a log, or several of one; the excited one when not given.
        input: Names of the input columns of a table, or variables of a .mat or .nc file.
        output: Names of the output columns, likewise.
        dt: Sampling interval of a table without one, s.
        time: Name of the column of times, when it is not t, time, stamp or the like.
        time_unit: Unit of the times: s, ms, us, ns, min or h.
        test: Which test of a 1553 record, by name or number.
        estimation_test: Which test of the record to identify from, likewise.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete. Gaps of the times still cut.
        skip: Leave out this much of the start of every record, s.
        keep_mean: Use the values as they are, without an operating point.
        steps: Horizon of a further prediction, samples.
        piece: Start and length of the part of the record that the figure shows, s; 5 s from the middle when not given.
        out: One figure of the outputs and errors (.svg, .png or .pdf).
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    import warnings

    from scenarios.files.data_file import joints_of, read_parts
    from scenarios.identification.model_comparison import compare_models, parsed
    from sysid.validation.cross_validation import same_samples

    names = [parsed(text) for text in dict.fromkeys(models)]
    if not names:
        raise ScenarioError("no model named; expected one or more after --models")
    if out is not None:
        check_figure(out, overwrite=overwrite)
    elif piece is not None:
        raise ScenarioError("--piece given without --out: it is the part of the record that a figure shows")
    identified = ", ".join(name.text for name in names if name.kind not in ("truth", "published", "file"))
    if estimation is not None and not identified:
        raise ScenarioError("--estimation given, but no model that is identified; name one, as oe:2/2/1")

    if len(set(joint)) < len(joint):
        raise ScenarioError(f"--joint {' '.join(joint)} given, expected each joint once")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        read = partial(read_parts, input=input, output=output, dt=dt, time=time, time_unit=time_unit, missing=missing)
        records = read(data, joint=joint, test=test)
        # The same joints, whichever the other record excites.
        others = read(estimation, joint=joint or joints_of(records[0]), test=estimation_test) if estimation else None
        parts, judged = compare_models(
            names,
            records,
            data,
            estimation=others,
            estimation_path=estimation,
            skip=skip,
            keep_mean=keep_mean,
            steps=steps,
            test=test,
        )
    texts = [str(warning.message) for warning in caught]
    if identified and (others is None or same_samples(records, others)):
        where = f"{data.name} itself" if estimation is None else f"{estimation.name}, which holds the same record"
        texts.append(f"{identified}: identified from {where}, so that the fit is no validation (--estimation)")
    if out is not None:
        draw(lambda: _figure(parts, judged, data, piece), out)
    first, samples = parts[0], sum(map(len, parts))
    if json:
        print_json(
            {
                "data": data,
                "estimation": (estimation or data) if identified else None,
                "inputs": first.input_names,
                "outputs": first.output_names,
                "samples": samples,
                "dt": first.dt,
                "models": [_record(model) for model in judged],
                "warnings": texts,
                "figure": out,
            }
        )
        return 0
    _print_models(judged, first.output_names or (), f"Models on {data.name}, {samples} samples every {first.dt:g} s")
    say_each("identified from: ", [estimation] if estimation else [])
    remarks: dict[str, list[str]] = {}
    for model in judged:
        for text in model.remarks:
            remarks.setdefault(text, []).append(model.label)
    for text, labels in remarks.items():
        # Remarks on printed models name their equation themselves.
        say(f"note: {text}" if labels[0].startswith("published") else f"{', '.join(labels)}: {text}")
    say_each("warning: ", texts)
    if out is not None:
        say(f"figure: {out}")
        if joints_of(first):
            say_next(*(("truth", "--data", data) if "truth" in models and data.suffix == ".nc" else ("truth",)))
    return 0


def _record(entry: "JudgedModel") -> dict[str, object]:
    """A model as JSON; of a single path bandwidth and gain are numbers, else rows of outputs."""
    import numpy as np

    from sysid import FrequencyResponse
    from sysid.models.bandwidth import gain_crossing

    model, single = entry.model, entry.model.nu == entry.model.ny == 1
    f = np.geomspace(1e-4, 0.5, 4000) / model.dt
    response = model.frequency_response(f)
    # Frequency of the gain 0.707 from each input to its own output; NaN where the gain starts below it.
    half_power = [
        gain_crossing(FrequencyResponse(f, response[:, k : k + 1, k : k + 1], model.dt, "model"), np.sqrt(0.5))
        for k in range(min(model.ny, model.nu))
    ]
    values = {"bandwidth_hz": entry.bandwidth_hz, "ci95": entry.ci95, "dc_gain": model.dc_gain()}
    return {
        "model": entry.label,
        "kind": entry.kind,
        "fit": {key: getattr(entry.fit, key) for key in ("simulation", "one_step", "steps", "ahead")},
        **{key: value[0, 0] if single else value for key, value in values.items()},
        "half_power_hz": half_power[0] if single else half_power,
        "poles": model.input_path().poles(),
        "stable": model.is_stable(),
        "operating_point": entry.level,
        "remarks": entry.remarks,
    }


def _print_models(judged: Sequence["JudgedModel"], outputs: Sequence[str], title: str) -> None:
    import numpy as np

    steps, several = judged[0].fit.steps, len(outputs) > 1
    columns = ["model", *(["output"] if several else []), "simulation %", "one step %"]
    columns += [f"{steps} steps %"] if steps > 1 else []
    columns += ["bandwidth Hz", "95 % interval", "gain at 0 Hz", "stable"]
    rows = []
    for entry in judged:
        gain, fit = entry.model.dc_gain(), entry.fit
        for i, name in enumerate(outputs):
            k = min(i, entry.model.nu - 1)
            hz, (low, high) = entry.bandwidth_hz[i, k], entry.ci95[i, k]
            fits = (fit.simulation, fit.one_step, fit.ahead) if steps > 1 else (fit.simulation, fit.one_step)
            row = [entry.label if i == 0 else "", *([name] if several else []), *(f"{one[i]:.2f}" for one in fits)]
            row += [f"{hz:.3f}" if np.isfinite(hz) else "—", f"{low:.3f} to {high:.3f}" if np.isfinite(low) else ""]
            row.append(f"{gain[i, k]:.3f}" if abs(gain[i, k]) < 1e9 else "—")
            rows.append([*row, "yes" if entry.model.is_stable() else "NO"])
    print_table(title, columns, rows)


def _figure(
    parts: Sequence["IOData"], judged: Sequence["JudgedModel"], data: Path, piece: tuple[float, float] | None
) -> "Figure":
    from sysid.plots import PALETTE, Trace, output_comparison

    longest, record = max(enumerate(parts), key=lambda entry: len(entry[1]))
    whole = len(record) * record.dt
    start, length = piece or (max(0.5 * (whole - DRAWN), 0.0), min(DRAWN, whole))
    if not (0.0 <= start < whole and length > 0.0):
        raise ScenarioError(f"--piece {start:g} {length:g} given, expected a start from 0 to below {whole:g} s")
    # The first model of a kind has the colour that the kind has everywhere; further ones take colours of absent kinds.
    looks = {entry.kind: PALETTE[entry.kind] for entry in judged if entry.kind in PALETTE}
    free = [look for name, look in PALETTE.items() if name not in (*looks, "measured", "etfe", "truth")]
    traces = []
    for entry in judged:
        fit = entry.fit.by_experiment[longest] if entry.fit.by_experiment else entry.fit
        style = looks.pop(entry.kind, None) or (free.pop(0) if free else PALETTE["published"])
        percents = ", ".join(f"{value:.1f}" for value in fit.simulation)
        traces.append(Trace(f"{entry.label}: fit {percents} %", fit.simulated + entry.level, style))
    radians = all(unit == "rad" for unit in record.output_units or ("",))
    scale, unit = (1000.0, "mrad") if radians else (1.0, None)
    figure = output_comparison(record, traces, start=start, length=length, scale=scale, unit=unit)
    figure.axes[0].set_title(f"{data.name}: simulated outputs", loc="left", fontsize=10)
    return figure

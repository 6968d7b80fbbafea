"""`hmtb compare`: models of any origin on a record, beside the truth."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import check_figure, draw, print_json, print_tables, say, say_each, say_next
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.identification.model_comparison import JudgedModel
    from sysid import IOData


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
    offset: bool = False,
    trend: bool = False,
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
    which they then fit better than any other; a warning says so, also of a model file that was identified from DATA.
    Warnings of the fit of a model file are repeated. Every model is judged about its own operating point, with its
    initial state fitted; integrators, and models that were identified beside a straight line in the output, also
    beside such a line. Files are read as by hmtb identify.

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
        time_unit: Unit of the times: s, ms, us, ns, min, h or days.
        test: Which test of a 1553 record, by name or number.
        estimation_test: Which test of the record to identify from, likewise.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete. Gaps of the times still cut.
        skip: Leave out this much of the start of every record, s.
        keep_mean: Use the values as they are, without an operating point.
        offset: Identify models with a constant of the output, as hmtb identify --offset.
        trend: Identify models with a straight line in the output, a drift, and judge all others beside one too.
        steps: Horizon of a further prediction, samples.
        piece: Start and length of the part of the record that the figure shows, s; 5 s from the middle when not given.
        out: One figure of the outputs and errors (.svg, .png or .pdf).
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    import warnings

    from scenarios.files.data_file import joints_of, read_parts
    from scenarios.identification.comparison_figures import outputs_figure
    from scenarios.identification.identification import trend_options
    from scenarios.identification.model_comparison import compare_models
    from scenarios.identification.named_models import parse_model_name
    from sysid.validation.cross_validation import same_samples

    names = [parse_model_name(name) for name in dict.fromkeys(models)]
    estimated = ", ".join(name.text for name in names if name.is_estimated)
    if not names:
        raise ScenarioError("no model named; expected one or more after --models")
    if out is None and piece is not None:
        raise ScenarioError("--piece given without --out: it is the part of the record that a figure shows")
    if out is not None:
        check_figure(out, overwrite=overwrite)
    if estimation is not None and not estimated:
        raise ScenarioError("--estimation given, but no model that is identified; name one, as oe:2/2/1")
    if len(set(joint)) < len(joint):
        raise ScenarioError(f"--joint {' '.join(joint)} given, expected each joint once")
    own_trend = trend_options(offset=offset, trend=trend, keep_mean=keep_mean)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        read = partial(read_parts, input=input, output=output, dt=dt, time=time, time_unit=time_unit, missing=missing)
        records = read(data, joint=joint, test=test)
        estimation_records = None
        if estimation is not None:
            # The same joints, whichever the other record excites.
            estimation_records = read(estimation, joint=joint or joints_of(records[0]), test=estimation_test)
        about_means, judged = compare_models(
            names,
            records,
            data,
            estimation=estimation_records,
            estimation_path=estimation,
            skip=skip,
            keep_mean=keep_mean,
            trend=own_trend,
            steps=steps,
            test=test,
        )
    remarks = [str(warning.message) for warning in caught]
    # Also the same samples under another name.
    if estimated and (estimation_records is None or same_samples(records, estimation_records)):
        remarks.append(_no_validation(estimated, data, estimation))
    if out is not None:
        draw(lambda: outputs_figure(about_means, judged, f"{data.name}: simulated outputs", piece), out)
    if json:
        source = (estimation or data) if estimated else None
        record = {**_json_record(about_means, judged, data), "estimation": source, "warnings": remarks, "figure": out}
        print_json(record)
        return 0
    _print(about_means, judged, data, estimation)
    say_each("warning: ", remarks)
    if out is not None:
        say(f"figure: {out}")
        if joints_of(about_means[0]):  # of another robot no truth is known
            of_record = ("--data", data) if "truth" in models and data.suffix == ".nc" else ()
            say_next("truth", *of_record)
    return 0


def _no_validation(estimated: str, data: Path, estimation: Path | None) -> str:
    """The warning that models fit the record that they are identified from better than any other."""
    origin = f"{data.name} itself" if estimation is None else f"{estimation.name}, which holds the same record"
    return f"{estimated}: identified from {origin}, so that the fit is no validation (--estimation)"


def _json_record(about_means: Sequence["IOData"], judged: Sequence["JudgedModel"], data: Path) -> dict[str, object]:
    """The record and the models on it as JSON."""
    first = about_means[0]
    return {
        "data": data,
        "inputs": first.input_names,
        "outputs": first.output_names,
        "samples": sum(map(len, about_means)),
        "dt": first.dt,
        "models": [model.record() for model in judged],
    }


def _print(
    about_means: Sequence["IOData"], judged: Sequence["JudgedModel"], data: Path, estimation: Path | None
) -> None:
    """Print the table of the models, the record that they are identified from, and remarks, each once."""
    from scenarios.identification.model_comparison import comparison_table

    first = about_means[0]
    title = f"Models on {data.name}, {sum(map(len, about_means))} samples every {first.dt:g} s"
    print_tables([comparison_table(judged, first.output_names or (), title)])
    if estimation is not None:
        say_each("identified from: ", [estimation])
    labels_of_remark: dict[str, list[str]] = {}
    for model in judged:
        for remark in model.remarks:
            labels_of_remark.setdefault(remark, []).append(model.label)
    for remark, labels in labels_of_remark.items():
        # Remarks on printed models name their equation themselves.
        is_of_print = labels[0].startswith("published")
        subject = "note" if is_of_print else ", ".join(labels)
        say(f"{subject}: {remark}")

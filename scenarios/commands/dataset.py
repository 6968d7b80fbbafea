"""`hmtb dataset`: list, get, show, check, export and score data sets; build and grade have files of their own."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, print_table, progress, say, say_each, say_next
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import counted
from scenarios.files.toml_file import read_toml
from scenarios.jobs.progress import How, show_progress

Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]


def list_(*, json: bool = False) -> int:
    """List the data sets that come with the package.

    Args:
        json: Print JSON.
    """
    from scenarios.datasets.canonical import canonical
    from scenarios.datasets.plan import DataSetPlan
    from scenarios.datasets.result_tables import plan_table
    from scenarios.datasets.spec import shipped

    plans = {label: DataSetPlan(spec) for label, spec in shipped().items()}
    costs = canonical()  # of the data sets that a release has built; others have none
    if json:
        records = []
        for label, plan in plans.items():
            cost = costs.get(label)
            sizes = {"megabytes": cost and cost.megabytes, "minutes": cost and cost.minutes}
            record = {"label": label, "title": plan.spec.title, "experiments": len(plan), "seconds": plan.seconds}
            records.append({**record, **sizes})
        print_json({"data_sets": records})
        return 0
    print_table(*plan_table(plans, costs))
    return 0


def get(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DATA_SET")],
    *,
    cache: Path | None = None,
    workers: int | None = None,
    progress: How = "auto",
    json: bool = False,
) -> int:
    """Get a data set from the cache, or build it there.

    A copy in the cache is checked to the last bit. Its records are compared with the canonical ones that the release
    names; the exit code is 1 if they differ. In Python: scenarios.load_dataset(NAME).

    Args:
        name: A data set that comes with the package (hmtb dataset list).
        cache: Folder of the copies; that of the variable HMTB_CACHE, or hmtb-twin in the user's cache, when not given.
        workers: Threads for the physics, all processors by default; the data do not depend on it.
        progress: How stderr shows the progress; auto is a bar on a terminal, else a line now and then.
        json: Print JSON.
    """
    from scenarios.datasets.canonical import canonical_verdict, load_dataset

    with show_progress(name, progress) as show:
        data_set = load_dataset(name, cache=cache, workers=workers, progress=show)
    same, line = canonical_verdict(data_set)
    if json:
        print_json({"path": data_set.folder, "records": data_set.records_hash, "canonical": same, "verdict": line})
    else:
        say(str(data_set.folder))
        say(line)
        say_next("dataset", "export", data_set.folder, "--format", "csv")
    return 0 if same else 1


def show(spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")], *, json: bool = False) -> int:
    """Show the spec of a data set as TOML, with all defaults.

    A data set of your own starts from one that exists: write it to a file, edit it, change its name, and build it:

      hmtb dataset show hmtb-siso-v1 > mine.toml
      hmtb dataset build mine.toml

    Args:
        spec: A data set that comes with the package (hmtb dataset list) or a TOML file.
        json: Print JSON.
    """
    from scenarios.datasets.spec import load_spec

    toml = load_spec(spec).to_toml()
    if json:
        print_json(read_toml(toml, spec))
    else:
        say(toml.rstrip())
    return 0


def check(
    folder: Folder,
    *,
    regenerate: int = 3,
    seed: int = 0,
    workers: int | None = None,
    json: bool = False,
) -> int:
    """Check files, hashes, metadata, and some experiments anew.

    The exit code is 1 if anything differs. With the software that built the data set, experiments that are simulated
    again must have the same bits; with other versions, numbers must agree to nine digits, and measured angles to one
    count of the resolver.

      hmtb dataset check hmtb-siso-v1

    Args:
        folder: The data set.
        regenerate: How many experiments to simulate again.
        seed: Seed by which they are chosen.
        workers: Threads for the physics.
        json: Print JSON.
    """
    from scenarios.datasets.check import examine

    with show_progress("checking") as report:
        result = examine(folder, regenerate=regenerate, seed=seed, workers=workers, progress=report)
    if json:
        print_json({"passed": result.passed, "problems": result.problems, "notes": result.notes})
    else:
        say_each("problem: ", result.problems)
        say_each("note: ", result.notes)
        verdict = "passed" if result.passed else counted(len(result.problems), "problem")
        say(f"{folder}: {verdict}")
    return 0 if result.passed else 1


def export(
    folder: Folder,
    *,
    format: str = "mat",
    out: Path = Path("."),
    json: bool = False,
) -> int:
    """Export the records as .mat, CSV, Parquet or ASCII files.

    Numbers are the same to the last bit. Each format gets a folder of its own, named after the data set. Only the data
    are exported, never the truth.

      hmtb dataset export hmtb-siso-v1 --format mat,csv --out exported

    Args:
        folder: The data set.
        format: Formats, separated by commas: mat (MATLAB 5), csv, parquet, ascii (the flat file of the thesis).
        out: Folder in which the folders of the formats are created.
        json: Print JSON.
    """
    from scenarios.exchange.exporter import export as export_data_set

    formats = [name.strip() for name in format.split(",") if name.strip()]
    with progress("exporting") as report:
        folders = export_data_set(folder, out, formats, progress=report)
    if json:
        print_json({"folders": folders})
    else:
        say_each("", folders)
        say_next("dataset", "check", folder)
    return 0


def score(
    predictions: Annotated[tuple[Path, ...], tyro.conf.Positional],
    *,
    data: Path,
    json: bool = False,
) -> int:
    """Score predicted outputs of the test part of a data set.

    The spec of the data set states the score: its metric, its unit, and how many steps ahead outputs are predicted. 0
    steps are a simulation: a prediction may use all inputs, but only the outputs of the initialisation window. With k
    steps it may also use outputs that are at least k samples older. The window is not scored. The overall score is the
    mean over all records and outputs of the test part; all of them must be predicted.

    Predictions are a folder, or files, one for each record of the test part. A file has the name of the experiment and
    all samples of the record, as angles in rad: EXPERIMENT.csv, whose first row names the outputs; EXPERIMENT.nc with
    a variable y of samples by outputs and their names in a variable output; EXPERIMENT.mat with a matrix y of samples
    by outputs.

      hmtb dataset score my-predictions --data hmtb-siso-v1

    Args:
        predictions: Folder or files of predictions.
        data: Folder of the data set.
        json: Print JSON.
    """
    from scenarios.datasets.result_tables import score_table
    from scenarios.datasets.score import score as score_predictions

    with progress("scoring"):
        result = score_predictions(predictions, data)
    rule = result.scoring
    if json:
        print_json(
            {
                "metric": rule.metric,
                "unit": rule.unit,
                "steps": rule.steps,
                "mean": result.mean,
                "joints": result.by_joint,
                "scores": [scored._asdict() for scored in result.scores],
            }
        )
        return 0
    print_table(*score_table(result))
    for joint, value in result.by_joint.items():
        say(f"{joint}: {value:.6g} {rule.unit}, mean over its records")
    how = f"{counted(rule.steps, 'step')} ahead" if rule.steps else "in simulation"
    say(f"score: {result.mean:.6g} {rule.unit} ({rule.metric} {how}, mean over all records and outputs)")
    return 0


def baselines(
    data: Annotated[Path, tyro.conf.Positional],
    *,
    method: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    orders: tuple[int, ...] = (),
    twins: int | None = None,
    records: int | None = None,
    json: bool = False,
) -> int:
    """Repeat a baseline, and compare it with the published row.

    The published row stands in baselines.csv of the data set. Models and their operating point are identified from the
    training part alone. They are scored as predictions are, with the initial state from the initialisation window.
    Where a record has several outputs, methods of one output identify one model for each. Without --method every row
    that the spec of the data set lists is repeated.

      hmtb dataset baselines hmtb-siso-v1 --method oe --orders 2 2 1
      hmtb dataset baselines hmtb-siso-v1 --method arx --orders 10 10      your own choice, for comparison

    Exit code 1: a row differs from the published one by more than 1e-9 of its value.

    Args:
        data: Folder of the data set.
        method: An estimator of hmtb identify; hold (last output of the window), gain (static) or truth (small signals).
        orders: Orders of the estimator, as for hmtb identify.
        twins: Number of randomised twins that get a model, evenly spaced; 0: all; by default as in the spec.
        records: Number of training records of each block, arm and set of joints; 0: all; by default as in the spec.
        json: Print JSON.
    """
    from dataclasses import replace

    from scenarios.datasets.baselines import BaselineData, differences, report
    from scenarios.datasets.data_set import open_data_set
    from scenarios.datasets.plan import BASELINES
    from scenarios.datasets.spec import Method
    from scenarios.datasets.tables import read_table

    if method is None and orders:
        raise ScenarioError(f"--orders {' '.join(map(str, orders))} given without --method")
    opened = open_data_set(data)
    planned = opened.spec.baselines
    chosen = {name: count for name, count in (("twins", twins), ("records", records)) if count is not None}
    bench = BaselineData(opened, replace(planned, **chosen))  # type: ignore[arg-type]
    methods = planned.methods if method is None else (Method(method, tuple(orders)),)
    rows = []
    with progress("baselines") as show:
        for k, baseline in enumerate(methods):
            show(k, len(methods), baseline.name)
            rows.append(report(bench, baseline)["row"])
    published = {row.get("command", ""): row for row in read_table(data / BASELINES)}
    different = {}
    for row in rows:
        command = row["command"]
        if command in published:  # a method of one's own is not
            different[command] = differences(row, published[command])
    # Other machines and versions differ in the last digits, which `differences` allows.
    code = 1 if any(different.values()) else 0
    if json:
        print_json({"rows": rows, "differences": different})
    else:
        _print_baselines(rows, different)
    return code


def _print_baselines(rows: Sequence[Mapping[str, str]], different: Mapping[str, Sequence[str]]) -> None:
    """Print the scores of baselines, and how they differ from the published rows."""
    from scenarios.datasets.result_tables import baseline_table

    print_table(*baseline_table(rows))
    for row in rows:
        remarks = [row["failed"]] if row["failed"] else different.get(row["command"], ["no such row is published"])
        say_each(f"{row['method']} {row['orders']}: ", remarks)
    matches = sum(not remarks for remarks in different.values())
    say(f"{matches} of {len(rows)} rows are as published")

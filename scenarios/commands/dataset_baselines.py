"""`hmtb dataset baselines`: what known methods reach on a data set, made again."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, print_table, say


def baselines(
    data: Annotated[Path, tyro.conf.Positional],
    /,
    *,
    method: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    orders: tuple[int, ...] = (),
    twins: int | None = None,
    records: int | None = None,
    json: bool = False,
) -> int:
    """Make a baseline of a data set again, and compare it with the row that is published in its baselines.csv.

    Models are identified from the training part alone, their operating point with them, and scored as predictions are:
    the initial state comes from the initialisation window. Where a record has several outputs, methods of one output
    identify one model for each. Without --method every row that the data set's spec asks for is made.

      hmtb dataset baselines hmtb-siso-v1 --method oe --orders 2 2 1
      hmtb dataset baselines hmtb-siso-v1 --method arx --orders 10 10      one's own choice, for comparison

    Exit code 1: a row differs from the published one by more than 1e-9 of its value.

    Args:
        data: Folder of the data set.
        method: An estimator of hmtb identify; hold (last output of the window), gain (static) or truth (small signals).
        orders: Orders of the estimator, as for hmtb identify.
        twins: For how many randomised twins, evenly over all, models are made, 0: all; by default as in the spec.
        records: Training records of each block, by arm and joints, that are used, 0: all; by default as in the spec.
        json: Print JSON.
    """
    from dataclasses import replace

    from scenarios.datasets.baseline_table import differences, read_table, report
    from scenarios.datasets.baselines import BaselineData
    from scenarios.datasets.data_set import open_data_set
    from scenarios.datasets.layout import BASELINES
    from scenarios.datasets.spec_tables import Method
    from scenarios.files.errors import ScenarioError

    if method is None and orders:
        raise ScenarioError(f"--orders {' '.join(map(str, orders))} given without --method")
    opened = open_data_set(data)
    asked = opened.spec.baselines
    bench = BaselineData(
        opened,
        replace(
            asked,
            twins=asked.twins if twins is None else twins,
            records=asked.records if records is None else records,
        ),
    )
    wanted = asked.methods if method is None else (Method(method, tuple(orders)),)
    made = [report(bench, one)["row"] for one in wanted]
    kept = {row.get("command", ""): row for row in read_table(data / BASELINES)} if (data / BASELINES).is_file() else {}
    different = {row["command"]: differences(row, kept[row["command"]]) for row in made if row["command"] in kept}
    if json:
        print_json({"rows": made, "differences": different})
    else:
        _print(made, different)
    return 1 if any(different.values()) else 0


def _print(rows: "list[dict[str, str]]", different: "Mapping[str, tuple[str, ...]]") -> None:
    first = rows[0]
    scores = [name for name in first if name == "test" or name.startswith("test_")] + ["validation"]
    title = (
        f"{first['metric']} / {first['unit']}, {'simulation' if first['steps'] == '0' else 'steps: ' + first['steps']}"
    )
    table = [
        [row["method"], row["orders"], *(f"{float(row[name]):.5g}" if row[name] else "" for name in scores)]
        for row in rows
    ]
    print_table(title, ["method", "orders", *(name.replace("test_", "test\n") for name in scores)], table)
    for row in rows:
        if row["failed"]:
            say(f"{row['method']} {row['orders']}: {row['failed']}")
        elif row["command"] not in different:
            say(f"{row['method']} {row['orders']}: no such row is published")
        for text in different.get(row["command"], ()):
            say(f"{row['method']} {row['orders']}: {text}")
    same = sum(1 for found in different.values() if not found)
    say(f"{same} of {len(rows)} rows are as published")

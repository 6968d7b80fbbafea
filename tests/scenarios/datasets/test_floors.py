"""The table of what no model can go below."""

import csv
import io
from dataclasses import replace
from pathlib import Path

import pytest

from scenarios.datasets.attainable_scores import TABLE, AttainableStage
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.spec_tables import Scoring


@pytest.mark.parametrize(("noise", "steps", "warns"), [(0.001, 1, True), (0.001, 0, False), (0.0, 1, False)])
def test_a_bound_that_no_model_reaches_says_so(
    tiny: Path, tiny_spec: DataSetSpec, noise: float, steps: int, warns: bool
) -> None:
    records = tuple(replace(block, process_noises=(noise,)) for block in tiny_spec.records)
    plan = DataSetPlan(replace(tiny_spec, records=records, scoring=Scoring(steps=steps)))
    (table,) = AttainableStage().make(plan, tiny, TABLE).values()
    (row,) = csv.DictReader(io.StringIO(table.decode()))
    assert ("no model does" in row["note"]) is warns

"""What docs/study.md says of the study is so."""

import re
from inspect import signature
from pathlib import Path
from typing import get_args

import pytest

import scenarios.thesis.study
from scenarios.commands.thesis import thesis
from scenarios.thesis.finding import CLAIMS, Verdict
from scenarios.thesis.frequencies import ORDER
from scenarios.thesis.study import ESTIMATION_TEST
from tests.benchmarks.claims import TABLES

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "study.md").read_text(encoding="utf-8")
CLAIM_LIST = (DOCS / "measured/thesis-claims.md").read_text(encoding="utf-8")


def test_the_switches_exist():
    used = set(re.findall(r"hmtb thesis --(\w+)", PAGE))
    assert used == {"seed", "seeds", "figures", "motion", "quick"}
    assert used < set(signature(thesis).parameters)


def test_the_verdicts_and_claims_are_all_there():
    listed = re.findall(r"^\| ([a-z ]+) \|", PAGE, flags=re.M)
    assert tuple(listed) == ORDER
    assert set(listed) == set(get_args(Verdict))
    assert f"{len(CLAIMS)} claims, {next(iter(CLAIMS))} to {list(CLAIMS)[-1]}" in PAGE
    assert f"test\n   {ESTIMATION_TEST}, the PRBS" in PAGE


@pytest.mark.parametrize("table", TABLES)
def test_the_tables_of_claims_are_those_of_the_record(table, capsys):
    (listed,) = re.findall(
        rf"<!-- measured by: python tests/benchmarks/claims.py {table} -->\n(.*?)<!-- end -->", CLAIM_LIST, flags=re.S
    )
    TABLES[table]()
    assert listed == capsys.readouterr().out


def test_every_claim_has_a_row_with_a_verdict_and_a_day():
    rows = re.findall(
        r"^\| (F\d+) \| .+ \| ([a-z ]+) \| (\d+ of \d+).* \| (\d{4}-\d\d-\d\d).* \|$", CLAIM_LIST, flags=re.M
    )
    assert [key for key, *_ in rows] == list(CLAIMS)
    assert {verdict for _, verdict, *_ in rows} <= set(get_args(Verdict))


def test_the_example_runs(study, monkeypatch, capsys):
    monkeypatch.setattr(scenarios.thesis.study, "run_study", lambda **_: study)
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.S)
    exec(compile(example, "docs/study.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == sum(len(joint.models) for joint in study.joints.values()) + len(CLAIMS)
    assert lines[-1].startswith(f"{list(CLAIMS)[-1]} ")

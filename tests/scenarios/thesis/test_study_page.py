"""What docs/study.md says of the study is so."""

import re
from inspect import signature
from pathlib import Path
from typing import get_args

import scenarios.thesis.study
from scenarios.commands.thesis import thesis
from scenarios.thesis.finding import CLAIMS, Verdict
from scenarios.thesis.frequencies import ORDER
from scenarios.thesis.study import ESTIMATION_TEST

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
    assert f"{len(CLAIMS)} claims of the thesis, {next(iter(CLAIMS))} to {list(CLAIMS)[-1]}" in PAGE
    assert f"test\n   {ESTIMATION_TEST}, the PRBS" in PAGE


def test_every_claim_is_listed():
    (listed,) = re.findall(r"<!-- claims: .*?-->\n(.*?)<!-- end of claims -->", CLAIM_LIST, flags=re.S)
    rows = [f"| {claim.key} | {claim.claim} | {claim.where} |" for claim in CLAIMS.values()]
    assert listed.splitlines() == ["| | Claim | Thesis |", "|---|---|---|", *rows]


def test_the_example_runs(study, monkeypatch, capsys):
    monkeypatch.setattr(scenarios.thesis.study, "run_study", lambda **_: study)
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.S)
    exec(compile(example, "docs/study.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == sum(len(joint.models) for joint in study.joints.values()) + len(CLAIMS)
    assert lines[-1].startswith(f"{list(CLAIMS)[-1]} ")

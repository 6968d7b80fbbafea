"""What a release consists of agrees: versions, the container, the workflow."""

import json
import re
import tomllib
from pathlib import Path

import yaml

from scenarios.commands.cli import COMMANDS

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOWS = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github/workflows").glob("*.yml")}
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")


def test_the_citation_has_the_version_of_the_package():
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == PROJECT["version"]


def test_the_tag_is_compared_with_the_version_of_the_package():
    (pattern,) = re.findall(r"sed -n 's/(.*?)/\\1/p' pyproject", WORKFLOWS["release.yml"])
    pattern = pattern.replace(r"\(", "(").replace(r"\)", ")")
    assert re.findall(pattern, (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.M) == [PROJECT["version"]]


def test_what_workflows_and_container_call_exists():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    text = "\n".join((*WORKFLOWS.values(), DOCKERFILE))
    called = {word for words in re.findall(r"(?:RUN|run:|-twin) make ([a-z- ]+)", text) for word in words.split()}
    assert {"install", "wheel", "docs", "thesis", "test-all"} == called <= targets
    assert set(re.findall(r"bin/hmtb (\w+)", text)) <= set(COMMANDS)
    container = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text(encoding="utf-8"))
    assert (ROOT / ".devcontainer" / container["build"]["dockerfile"]).resolve() == ROOT / "Dockerfile"


def test_workflows_use_what_the_build_job_leaves():
    jobs = yaml.safe_load(WORKFLOWS["release.yml"])["jobs"]
    needs = [jobs[name].get("needs", []) for name in jobs]
    assert {name for need in needs for name in ([need] if isinstance(need, str) else need)} <= set(jobs)
    steps = [step for job in jobs.values() for step in job["steps"] if "artifact@v4" in step.get("uses", "")]
    assert [step["with"] for step in steps] == [{"name": "dist", "path": "dist/"}] * 3

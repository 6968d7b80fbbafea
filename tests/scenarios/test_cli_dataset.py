"""`hmtb dataset`: its commands, their help, and one clear line for everything that a user can get wrong."""

import json
import tomllib

import pytest

from scenarios.cli import COMMANDS, main
from scenarios.commands.dataset import DATASET
from scenarios.datasets.spec import DataSetSpec, load_spec, shipped


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize("words", [["dataset"], ["dataset", "--help"], ["dataset", "-h"]])
def test_help_names_every_command(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    code, out, err = run(capsys, *words)
    assert (code, err) == (0, "")
    assert all(f"• {name} " in out for name in DATASET)
    assert "dataset" in COMMANDS
    assert "• dataset " in run(capsys, "--help")[1]


@pytest.mark.parametrize("name", DATASET)
def test_every_command_has_help(capsys: pytest.CaptureFixture[str], name: str) -> None:
    code, out, err = run(capsys, "dataset", name, "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"usage: hmtb dataset {name} ")


@pytest.mark.parametrize("columns", ["40", "200"])
@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("nonsense", "unknown command 'nonsense'; there are: list, show, build"),
        ("buld hmtb-siso-v1", "unknown command 'buld': did you mean 'build'? There are: list, show, build"),
        ("build", "missing SPEC; see hmtb dataset build --help"),
        ("build hmtb-siso-v1 --out", "--out needs a value; see hmtb dataset build --help"),
        ("build hmtb-siso-v1 --workers two", "--workers: expected a whole number, given two"),
        ("build hmtb-siso-v1 elsewhere", "unexpected argument 'elsewhere'; see hmtb dataset build --help"),
        ("build hmtb-sisu-v1", "unknown data set 'hmtb-sisu-v1': did you mean 'hmtb-siso-v1'"),
        ("build mine.toml", "no file mine.toml: expected a spec"),
        ("show", "missing SPEC"),
    ],
)
def test_usage_errors_are_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: str, words: str, says: str
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    code, out, err = run(capsys, "dataset", *words.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("hmtb: ")
    assert says in err


def test_data_sets_are_listed_and_shown(capsys: pytest.CaptureFixture[str]) -> None:
    listed = json.loads(run(capsys, "dataset", "list", "--json")[1])["data_sets"]
    assert [entry["label"] for entry in listed] == list(shipped())
    spec = load_spec("hmtb-siso-v1")
    out = run(capsys, "dataset", "show", "hmtb-siso-v1")[1]
    assert DataSetSpec.from_toml(out) == spec
    assert json.loads(run(capsys, "dataset", "show", "hmtb-siso-v1", "--json")[1]) == tomllib.loads(spec.to_toml())

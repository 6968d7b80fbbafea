"""`hmtb dataset`: benchmark data sets, built, checked, exported and scored; a command per file."""

from collections.abc import Callable

from scenarios.commands.dataset_baselines import baselines
from scenarios.commands.dataset_build import build
from scenarios.commands.dataset_check import check
from scenarios.commands.dataset_export import export
from scenarios.commands.dataset_grade import grade
from scenarios.commands.dataset_list import list_
from scenarios.commands.dataset_score import score
from scenarios.commands.dataset_show import show

DESCRIPTION = """Benchmark data sets with exact truth: built from a spec, checked, exported and scored.

Start with:

  hmtb dataset list                               the data sets that come with the package
  hmtb dataset show hmtb-siso-v1                  one as TOML, to start one's own from
  hmtb dataset build hmtb-siso-v1                 build it; the same command goes on where it was interrupted
  hmtb dataset check hmtb-siso-v1                 whether a copy is whole, and still what its spec gives
  hmtb dataset export hmtb-siso-v1 --format csv   its records for other programs
  hmtb dataset score PREDICTIONS --data hmtb-siso-v1      one's own predictions of the test part
  hmtb dataset baselines hmtb-siso-v1 --method oe --orders 2 2 1      what a known method reaches
  hmtb dataset grade SUBMISSIONS --key class.key          what students hand in, where the truth is hidden

Every command has its own --help.
"""
"""What the help of `hmtb dataset` says."""

DATASET: dict[str, Callable[..., int]] = {
    "list": list_,
    "show": show,
    "build": build,
    "check": check,
    "export": export,
    "score": score,
    "baselines": baselines,
    "grade": grade,
}
"""What can be done with data sets, by the word after `hmtb dataset`; a command is a function in a file of its own."""


def dataset() -> int:
    """List, build, check, export or score benchmark data sets; see hmtb dataset --help."""
    raise NotImplementedError  # only its text is used: the words that follow name a command of DATASET

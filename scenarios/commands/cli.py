"""The command line `hmtb`: it finds the command, reads its options, runs it, and turns errors into exit codes."""

import os
import shlex
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module, metadata
from pathlib import Path

from scenarios.commands.dataset import DATA_SET_COMMANDS
from scenarios.commands.dataset import DESCRIPTION as DATA_SETS
from scenarios.commands.usage import listing, read_options
from scenarios.files.errors import ScenarioError, unknown

DESCRIPTION = """A twin of NASA's Hydraulic Manipulator Test Bed, and the identification study on it.

Start with:

  hmtb thesis                                     the whole study, ending in report.html
  hmtb scenarios                                  the experiments that exist
  hmtb preview siso-5-elbow_pitch                 the commands of an experiment, before anything moves
  hmtb simulate siso-5-elbow_pitch                run it and write its log
  hmtb identify siso-5-elbow_pitch.nc --method oe --orders 2 2 1
  hmtb compare siso-8-elbow_pitch.nc --estimation siso-5-elbow_pitch.nc --models truth published oe:2/2/1
  hmtb truth                                      the true poles, zeros, bandwidths, gains and delays
  hmtb bandwidth                                  is every joint's bandwidth about 1 Hz?
  hmtb dataset list                               benchmark data sets, to build, check and score
  hmtb verify my_module:my_estimator --quick      your own estimator on the test bench
  hmtb leaderboard results/*.json                 estimators of the test bench side by side

Every command has its own --help; hmtb --version prints the release.
Exit codes: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted.
"""

COMMANDS = (
    "thesis",
    "simulate",
    "scenarios",
    "waveform",
    "preview",
    "truth",
    "bandwidth",
    "identify",
    "compare",
    "convert",
    "dataset",
    "verify",
    "leaderboard",
    "view",
    "video",
)
"""Each is a function of its name in a module of its name, imported when it is needed."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: Words after `hmtb`; those of the process when not given.

    Returns:
        Exit code: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted.
    """
    _open_streams()
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if words in (["--version"], ["version"]):
        print(f"hmtb {_version()}")
        return 0
    try:
        call = parse(words)
        if isinstance(call, str):
            sys.stdout.write(call)
        code = 0 if isinstance(call, str) else call()
        sys.stdout.flush()
        return code
    except KeyboardInterrupt as interruption:
        # A command that saves its progress says in the exception what is saved.
        saved = f"{interruption}; run the command again to resume" if str(interruption) else "run the command again"
        print(f"hmtb: interrupted; {saved}: {shlex.join(['hmtb', *words])}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # `hmtb ... | head`: the reader has left, which is no error
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        line = _bad_input(error)
        if line is None:
            raise
        print(f"hmtb: {line}", file=sys.stderr)
        return 2


def _open_streams() -> None:
    """Open the null device for a stream that the caller closed (`hmtb ... >&-`), which Python shows as None."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - open to the end


def parse(words: list[str]) -> Callable[[], int] | str:
    """The command that the words name, with its options, ready to run; or the help that they ask for.

    Raises:
        ScenarioError: The words name no command, or the command does not take them.
    """
    program, description, places = "hmtb", DESCRIPTION, {name: f"{name}:{name}" for name in COMMANDS}
    if words[0] == "dataset":
        program, description, places, words = "hmtb dataset", DATA_SETS, DATA_SET_COMMANDS, words[1:] or ["--help"]
    name, *options = words
    if name in ("-h", "--help"):
        return listing(program, description, {name: _command(place) for name, place in places.items()})
    if name not in places:
        raise ScenarioError(unknown("command", name, places))
    return read_options(_command(places[name]), f"{program} {name}", options)


def _command(place: str) -> Callable[..., int]:
    module, _, function = place.partition(":")
    command: Callable[..., int] = getattr(import_module(f"scenarios.commands.{module}"), function)
    return command


def _version() -> str:
    try:
        return metadata.version("hmtb-twin")
    except metadata.PackageNotFoundError:
        return "of a checkout that is not installed"


def _bad_input(error: Exception) -> str | None:
    """The message for an error that the user can fix; None for a bug, which keeps its traceback."""
    ours = {kind.__module__.partition(".")[0] for kind in type(error).__mro__} & {"scenarios", "hmtb_twin", "sysid"}
    if ours and isinstance(error, ValueError):
        return " ".join(str(error).split())
    back_end = os.environ.get("MUJOCO_GL")
    if back_end and any("gl_context" in frame.filename for frame in traceback.extract_tb(error.__traceback__)):
        return f"MUJOCO_GL={back_end!r} names no OpenGL back end that loads here; unset it, or set it to egl"
    if isinstance(error, OSError):
        from hmtb_twin.parameters.errors import system_reason

        where = f" {error.filename!r}" if error.filename else ""
        return f"cannot read or write{where}: {system_reason(error)}"
    return None

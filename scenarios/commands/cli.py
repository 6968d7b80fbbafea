"""The command line `hmtb`: it finds the command, reads its options, runs it, and turns errors into exit codes."""

import contextlib
import functools
import inspect
import io
import os
import re
import shlex
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module, metadata
from pathlib import Path
from typing import ParamSpec

import tyro

from scenarios.commands.dataset import DATA_SET_COMMANDS
from scenarios.commands.dataset import DESCRIPTION as DATA_SETS
from scenarios.commands.output import reason
from scenarios.commands.usage import complaint, listing, wrapped
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
        code = parse(words)()
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


def parse(words: list[str]) -> Callable[[], int]:
    """The command that the words name, with its options, ready to run; or help, ready to be printed.

    Raises:
        ScenarioError: The words name no command, or the command does not take them.
    """
    program, description = "hmtb", DESCRIPTION
    commands: Mapping[str, Callable[[], Callable[..., int]]] = {
        name: functools.partial(_command, name) for name in COMMANDS
    }
    if words[0] == "dataset":
        program, description, words = "hmtb dataset", DATA_SETS, words[1:] or ["--help"]
        commands = {name: functools.partial(_data_set_command, name) for name in DATA_SET_COMMANDS}
    name, *options = words
    if name in ("-h", "--help"):
        text = listing(program, description, {name: load() for name, load in commands.items()})
        return functools.partial(_write, text)
    if name not in commands:
        raise ScenarioError(unknown("command", name, commands))
    return _parsed(commands[name](), f"{program} {name}", options)


def _write(text: str) -> int:
    sys.stdout.write(text)
    return 0


def _command(name: str) -> Callable[..., int]:
    command: Callable[..., int] = getattr(import_module(f"scenarios.commands.{name}"), name)
    return command


def _data_set_command(name: str) -> Callable[..., int]:
    module, _, function = DATA_SET_COMMANDS[name].partition(":")
    command: Callable[..., int] = getattr(import_module(f"scenarios.commands.{module}"), function)
    return command


Options = ParamSpec("Options")


def _parsed(command: Callable[Options, int], program: str, words: Sequence[str]) -> Callable[[], int]:
    """The command with its options, ready to run, or its help.

    Raises:
        ScenarioError: The command does not take the words.
    """

    @functools.wraps(command)
    def fill(*args: Options.args, **kwargs: Options.kwargs) -> Callable[[], int]:
        return functools.partial(command, *args, **kwargs)

    # The parser keeps the line breaks in the description of an option, so here they go; it reads a wrapped function.
    fill.__signature__ = inspect.signature(command)  # type: ignore[attr-defined]
    del fill.__wrapped__
    fill.__doc__ = re.sub(r"\n {8}(?=\S)", " ", inspect.cleandoc(command.__doc__ or ""))

    def understand() -> Callable[[], int]:
        call: Callable[[], int] = tyro.cli(
            fill,
            prog=program,
            args=words,
            config=(tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff),
        )
        return call

    # The parser draws its boxes as far as the encoding of the output allows.
    help_text = io.TextIOWrapper(io.BytesIO(), encoding=sys.stdout.encoding or "utf-8")
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(help_text):
            return understand()
    except SystemExit as leaving:
        if leaving.code:
            raise ScenarioError(complaint(understand, program)) from None
        help_text.seek(0)
        return functools.partial(_write, wrapped(help_text.read()))


def _version() -> str:
    try:
        return metadata.version("hmtb-twin")
    except metadata.PackageNotFoundError:
        return "of a checkout that is not installed"


def _bad_input(error: Exception) -> str | None:
    """The line for an error that the user can mend; None for a fault of ours, which keeps its traceback."""
    ours = {kind.__module__.partition(".")[0] for kind in type(error).__mro__} & {"scenarios", "hmtb_twin", "sysid"}
    if ours and isinstance(error, ValueError):
        return " ".join(str(error).split())
    back_end = os.environ.get("MUJOCO_GL")
    if back_end and any("gl_context" in frame.filename for frame in traceback.extract_tb(error.__traceback__)):
        return f"MUJOCO_GL={back_end!r} names no OpenGL back end that loads here; unset it, or set it to egl"
    if isinstance(error, OSError):
        where = f" {error.filename!r}" if error.filename else ""
        return f"cannot read or write{where}: {reason(error)}"
    return None

"""The command line `hmtb`: dispatch, exit codes, one clear line for bad input."""

import contextlib
import functools
import io
import os
import shlex
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import ParamSpec

import tyro

from scenarios.commands.bandwidth import bandwidth
from scenarios.commands.compare import compare
from scenarios.commands.convert import convert
from scenarios.commands.dataset import DATASET, dataset
from scenarios.commands.dataset import DESCRIPTION as DATASET_DESCRIPTION
from scenarios.commands.identify import identify
from scenarios.commands.leaderboard import leaderboard
from scenarios.commands.output import reason
from scenarios.commands.preview import preview
from scenarios.commands.scenarios import scenarios
from scenarios.commands.simulate import simulate
from scenarios.commands.thesis import thesis
from scenarios.commands.truth import truth
from scenarios.commands.usage import one_line, wrapped
from scenarios.commands.verify import verify
from scenarios.commands.video import video
from scenarios.commands.view import view
from scenarios.commands.waveform import waveform
from scenarios.files.errors import ScenarioError, unknown

DESCRIPTION = """A twin of NASA's Hydraulic Manipulator Test Bed, and the identification study on it.

Start with:

  hmtb thesis                                     the whole study, ending in report.html
  hmtb scenarios                                  the experiments that exist
  hmtb preview siso-5-elbow_pitch                 what one of them will command, before anything moves
  hmtb simulate siso-5-elbow_pitch                run it, to a file
  hmtb identify siso-5-elbow_pitch.nc --method oe --orders 2 2 1
  hmtb compare siso-8-elbow_pitch.nc --estimation siso-5-elbow_pitch.nc --models truth published oe:2/2/1
  hmtb truth                                      what an estimator should have found
  hmtb bandwidth                                  is every joint's bandwidth about 1 Hz?
  hmtb dataset list                               benchmark data sets, to build, check and score
  hmtb verify my_module:my_estimator --quick      your own estimator on the test bench
  hmtb leaderboard results/*.json                 estimators of the test bench side by side

Every command has its own --help; hmtb --version says which release this is.
Exit codes: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted.
"""

COMMANDS: dict[str, Callable[..., int]] = {
    "thesis": thesis,
    "simulate": simulate,
    "scenarios": scenarios,
    "waveform": waveform,
    "preview": preview,
    "truth": truth,
    "bandwidth": bandwidth,
    "identify": identify,
    "compare": compare,
    "convert": convert,
    "dataset": dataset,
    "verify": verify,
    "leaderboard": leaderboard,
    "view": view,
    "video": video,
}

GROUPS: dict[str, tuple[str, dict[str, Callable[..., int]]]] = {"dataset": (DATASET_DESCRIPTION, DATASET)}
"""Commands that the first word only groups: the text of its help, and the commands by the second word."""


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
        code = _understand(words)()
        sys.stdout.flush()
        return code
    except SystemExit:  # --help
        return 0
    except KeyboardInterrupt as interruption:
        again = shlex.join(["hmtb", *words])
        # What has been kept, where a command keeps anything.
        kept = f"{interruption}; to go on" if str(interruption) else "to start again"
        print(f"hmtb: interrupted; {kept}: {again}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # `hmtb ... | head`: nobody reads on, which is no fault
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        line = _bad_input(error)
        if line is None:
            raise
        print(f"hmtb: {line}", file=sys.stderr)
        return 2


def _open_streams() -> None:
    """Send what goes to a stream that the caller closed (`hmtb ... >&-`), which Python shows as None, nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - open to the end


Options = ParamSpec("Options")


def _understand(words: list[str]) -> Callable[[], int]:
    """The command that the words name, with its options, ready to run.

    Raises:
        ScenarioError: The words name no command, or the command does not take them.
        SystemExit: Help was asked for and is printed.
    """
    program, description, commands = "hmtb", DESCRIPTION, COMMANDS
    if words[0] in GROUPS:
        program, (description, commands), words = f"hmtb {words[0]}", GROUPS[words[0]], words[1:] or ["--help"]
    if words[0] not in commands and words[0] not in ("-h", "--help"):
        raise ScenarioError(unknown("command", words[0], commands))

    def parse() -> Callable[[], int]:
        parsed: Callable[[], int] = tyro.extras.subcommand_cli_from_dict(
            {name: _later(command) for name, command in commands.items()},
            prog=program,
            description=description,
            args=words,
            config=(tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff),
        )
        return parsed

    complaint = io.StringIO()
    # The parser draws its boxes as far as the encoding of the output goes.
    help_text = io.TextIOWrapper(io.BytesIO(), encoding=sys.stdout.encoding or "utf-8")
    try:
        with contextlib.redirect_stderr(complaint), contextlib.redirect_stdout(help_text):
            return parse()
    except SystemExit as leaving:
        if not leaving.code:
            help_text.seek(0)
            sys.stdout.write(wrapped(help_text.read()))
            raise
        raise ScenarioError(one_line(parse, f"{program} {words[0]}")) from None


def _later(command: Callable[Options, int]) -> Callable[Options, Callable[[], int]]:
    """The command, of which the parser only fills in the options: words are understood before anything runs."""

    @functools.wraps(command)
    def filled(*args: Options.args, **kwargs: Options.kwargs) -> Callable[[], int]:
        return functools.partial(command, *args, **kwargs)

    return filled


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

"""The command line `hmtb`: dispatch, exit codes, one clear line for bad input."""

import os
import sys
from collections.abc import Callable, Sequence

import tyro

from scenarios.commands.identify import identify
from scenarios.commands.scenarios import scenarios
from scenarios.commands.simulate import simulate
from scenarios.commands.thesis import thesis
from scenarios.commands.truth import truth
from scenarios.commands.waveform import waveform

DESCRIPTION = """A twin of NASA's Hydraulic Manipulator Test Bed, and the identification study on it.

Start with:

  hmtb thesis                                     the whole study, ending in report.html
  hmtb scenarios                                  the experiments that exist
  hmtb simulate siso-5-elbow_pitch                one of them, to a file
  hmtb identify siso-5-elbow_pitch.nc --method oe --orders 2 2 1
  hmtb truth                                      what an estimator should have found

Every command has its own --help. Exit codes: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted.
"""

COMMANDS: dict[str, Callable[..., int]] = {
    "thesis": thesis,
    "simulate": simulate,
    "scenarios": scenarios,
    "waveform": waveform,
    "truth": truth,
    "identify": identify,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: Words after `hmtb`; those of the process when not given.

    Returns:
        Exit code: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted.
    """
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    try:
        code: int = tyro.extras.subcommand_cli_from_dict(
            COMMANDS,
            prog="hmtb",
            description=DESCRIPTION,
            args=words,
            config=(tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff),
        )
        sys.stdout.flush()
        return code
    except SystemExit as leaving:  # --help and usage errors; the latter already carry 2
        return leaving.code if isinstance(leaving.code, int) else 2
    except KeyboardInterrupt:
        print("hmtb: interrupted", file=sys.stderr)
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


def _bad_input(error: Exception) -> str | None:
    """The line for an error that the user can mend; None for a fault of ours, which keeps its traceback."""
    ours = {kind.__module__.partition(".")[0] for kind in type(error).__mro__} & {"scenarios", "hmtb_twin", "sysid"}
    if ours and isinstance(error, ValueError):
        return " ".join(str(error).split())
    if isinstance(error, OSError):
        where = f" {error.filename!r}" if error.filename else ""
        return f"cannot read or write{where}: {error.strerror or error}"
    return None

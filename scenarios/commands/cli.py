"""The command line `hmtb`: it finds the command, reads its options, runs it, and turns errors into exit codes."""

import os
import resource
import shlex
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from scenarios.commands.usage import completion_script, in_options, listing, read_options
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.printable import one_line
from scenarios.files.toml_file import read_toml
from scenarios.jobs.progress import show_activity

PROGRAMS: dict[str, dict[str, Any]] = read_toml(
    Path(__file__).with_name("programs.toml").read_text(encoding="utf-8"), "programs.toml"
)
"""Help and commands of `hmtb` and `hmtb dataset`; the function of a command is imported when it is needed."""

DATA_SETS = Path(__file__).parents[1] / "data" / "datasets"
"""Specs that come with the package, NAME.toml."""

LEAST_ADDRESSES = 2**30
"""Bytes. With fewer, libraries end the process or fail in ways of their own while they are loaded."""

COMMANDS = tuple(PROGRAMS["hmtb"]["commands"])
"""Words after `hmtb`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: Words after `hmtb`; those of the process when not given.

    Returns:
        Exit code: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted.
    """
    _open_streams()
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    call: partial[int] | str = ""
    try:
        if words in (["--version"], ["version"]):
            call = f"hmtb {_version()}\n"
        else:
            _check_memory()
            call = parse(words)
        code = 0
        if isinstance(call, str):
            sys.stdout.write(call)
        else:
            _check_ordinary(call)
            with show_activity((call.func.__doc__ or "").partition("\n")[0]):
                code = call()
        sys.stdout.flush()
        return code
    except KeyboardInterrupt as interruption:
        # A command that saves its progress says in the exception what is saved.
        saved = f"{interruption}; run the command again to resume" if str(interruption) else "run the command again"
        again = "".join(c if c.isprintable() else "?" for c in shlex.join(["hmtb", *words]))
        print(f"hmtb: interrupted; {saved}: {again}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # `hmtb ... | head`: the reader has left, which is no error
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        line = _bad_input(error)
        if line is None:
            raise
        from hmtb_twin.files.errors import abridged

        if not isinstance(call, str):
            line = in_options(line, error, call.func)
        with suppress(OSError):  # nobody may be able to read it
            print(f"hmtb: {one_line(abridged(line))}", file=sys.stderr, flush=True)
        return 2


def _open_streams() -> None:
    """Open the null device for a stream that the caller closed (`hmtb ... >&-`), which Python shows as None."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - open to the end
        with suppress(AttributeError):
            getattr(sys, name).reconfigure(errors="backslashreplace")  # a terminal may lack the signs of a name


def parse(words: list[str]) -> partial[int] | str:
    """The command that the words name, with its options, ready to run; or the help that they ask for.

    Raises:
        ScenarioError: The words name no command, or the command does not take them.
    """
    program, name, *options = ("hmtb", *words)
    if f"hmtb {name}" in PROGRAMS:
        program, name, *options = (f"hmtb {name}", *(options or ["--help"]))
    places = PROGRAMS[program]["commands"]
    if name in ("-h", "--help"):
        texts = {
            one: _command(place).__doc__ or "" if place else PROGRAMS[f"{program} {one}"]["summary"]
            for one, place in places.items()
        }
        return listing(program, PROGRAMS[program]["description"], texts)
    if name not in places:
        raise ScenarioError(unknown("command", name, places))
    return read_options(_command(places[name]), f"{program} {name}", options)


def completion(shell: Annotated[Literal["bash", "zsh", "fish"], tyro.conf.Positional]) -> int:
    """Print a script that completes commands and names in a shell.

    It completes commands, options, their values, and names of scenarios and data sets. Print it again after an update.

      hmtb completion bash > ~/.local/share/bash-completion/completions/hmtb
      hmtb completion zsh > ~/.hmtb-completion      and in .zshrc, after compinit: source ~/.hmtb-completion
      hmtb completion fish > ~/.config/fish/completions/hmtb.fish

    Args:
        shell: The shell.
    """
    from scenarios.commands.output import say
    from scenarios.experiments.registry import names, tags

    data_sets = tuple(entry.stem for entry in sorted(DATA_SETS.glob("*.toml")))
    known = {"SCENARIO": tuple(dict.fromkeys((*names(), *tags()))), "DATA_SET": data_sets, "SPEC": data_sets}
    commands = {
        f"{program} {name}".removeprefix("hmtb "): _command(place)
        for program, table in PROGRAMS.items()
        for name, place in table["commands"].items()
        if place
    }
    groups = {program.removeprefix("hmtb").strip(): list(table["commands"]) for program, table in PROGRAMS.items()}
    say(completion_script(shell, groups, commands, known).rstrip())
    return 0


def _command(place: str) -> Callable[..., int]:
    module, _, function = place.partition(":")
    command: Callable[..., int] = getattr(import_module(f"scenarios.commands.{module}"), function)
    return command


def _version() -> str:
    try:
        return metadata.version("hmtb-twin")
    except metadata.PackageNotFoundError:
        return "of a checkout that is not installed"


def _check_memory() -> None:
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < LEAST_ADDRESSES:
        raise MemoryError(f"ulimit -v allows {limit // 1024} kB, a command needs {LEAST_ADDRESSES // 1024}")


def _check_ordinary(call: partial[int]) -> None:
    """Refuse arguments that name pipes, sockets or devices: reading may never end, and no file replaces a device."""
    given = (*call.args, *call.keywords.values())
    values = [one for each in given for one in (each if isinstance(each, tuple) else (each,))]
    files = [one for one in values if isinstance(one, str | Path) and os.path.exists(one) and not os.path.isdir(one)]
    for file in files:
        if not os.path.isfile(file):
            raise ScenarioError(f"{str(file)!r} is a pipe, a socket or a device; expected an ordinary file")


def _bad_input(error: Exception) -> str | None:
    """The message for an error that the user can fix; None for a bug, which keeps its traceback."""
    ours = {kind.__module__.partition(".")[0] for kind in type(error).__mro__} & {"scenarios", "hmtb_twin", "sysid"}
    if ours and isinstance(error, ValueError):
        return " ".join(str(error).split())
    back_end = os.environ.get("MUJOCO_GL")
    if back_end and any("gl_context" in frame.filename for frame in traceback.extract_tb(error.__traceback__)):
        return f"MUJOCO_GL={back_end!r} names no OpenGL back end that loads here; unset it, or set it to egl"
    words = {"ImportError": "failed to map", "FatalError": "allocate memory"}.get(type(error).__name__)
    if isinstance(error, MemoryError) or (words and words in str(error)):  # FatalError is MuJoCo's
        return f"not enough memory ({str(error) or 'no size known'}); expected more, a shorter record or lower orders"
    if isinstance(error, OSError):
        from hmtb_twin.files.errors import system_reason

        where = f" {error.filename!r}" if error.filename else ""
        return f"cannot read or write{where}: {system_reason(error)}"
    return None

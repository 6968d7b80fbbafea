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
    words = [*sys.argv[1:]] if arguments is None else [*arguments]
    words = words or ["--help"]
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
        _say_interrupted(str(interruption), words)
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


def _say_interrupted(saved: str, words: Sequence[str]) -> None:
    """Say what was saved, which a command that saves its progress says in the exception, and how to go on."""
    advice = f"{saved}; run the command again to resume" if saved else "run the command again"
    command = shlex.join(["hmtb", *words])
    for character in set(command):
        if not character.isprintable():  # it may steer the terminal
            command = command.replace(character, "?")
    print(f"hmtb: interrupted; {advice}: {command}", file=sys.stderr)


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
    # `hmtb dataset` is a program of its own, whose commands come a word later.
    program, name, *options = ("hmtb", *words)
    if f"hmtb {name}" in PROGRAMS:
        program, name, *options = (f"hmtb {name}", *(options or ["--help"]))
    functions = PROGRAMS[program]["commands"]
    if name in ("-h", "--help"):
        help_texts = {}
        for command, function in functions.items():
            # A program of its own has no function, and its summary in the table.
            is_program = not function
            summary = PROGRAMS[f"{program} {command}"]["summary"] if is_program else _command(function).__doc__
            help_texts[command] = summary or ""
        return listing(program, PROGRAMS[program]["description"], help_texts)
    if name not in functions:
        raise ScenarioError(unknown("command", name, functions))
    return read_options(_command(functions[name]), f"{program} {name}", options)


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

    data_sets = tuple(path.stem for path in sorted(DATA_SETS.glob("*.toml")))
    known = {"SCENARIO": tuple(dict.fromkeys((*names(), *tags()))), "DATA_SET": data_sets, "SPEC": data_sets}
    commands, groups = {}, {}
    for program, table in PROGRAMS.items():
        words = program.removeprefix("hmtb").strip()
        groups[words] = list(table["commands"])
        for name, function in table["commands"].items():
            if function:
                commands[f"{words} {name}".strip()] = _command(function)
    say(completion_script(shell, groups, commands, known).rstrip())
    return 0


def _command(function: str) -> Callable[..., int]:
    """The function of a command, from MODULE:FUNCTION of this room."""
    module, _, name = function.partition(":")
    command: Callable[..., int] = getattr(import_module(f"scenarios.commands.{module}"), name)
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
    values: list[object] = []
    for value in (*call.args, *call.keywords.values()):
        values += value if isinstance(value, tuple) else [value]
    files = []
    for value in values:
        # Names of scenarios and data sets are no files, unless a file has that name.
        if isinstance(value, str | Path) and os.path.exists(value) and not os.path.isdir(value):
            files.append(value)
    for file in files:
        if not os.path.isfile(file):
            raise ScenarioError(f"{str(file)!r} is a pipe, a socket or a device; expected an ordinary file")


def _bad_input(error: Exception) -> str | None:
    """The message for an error that the user can fix; None for a bug, which keeps its traceback."""
    packages = {base.__module__.partition(".")[0] for base in type(error).__mro__}
    if isinstance(error, ValueError) and packages & {"scenarios", "hmtb_twin", "sysid"}:
        return " ".join(str(error).split())
    # The back end fails inside MuJoCo's own modules, when they are loaded.
    back_end = os.environ.get("MUJOCO_GL")
    if back_end and any("gl_context" in frame.filename for frame in traceback.extract_tb(error.__traceback__)):
        return f"MUJOCO_GL={back_end!r} names no OpenGL back end that loads here; unset it, or set it to egl"
    if _is_out_of_memory(error):
        return f"not enough memory ({str(error) or 'no size known'}); expected more, a shorter record or lower orders"
    if isinstance(error, FileNotFoundError) and not _has_working_folder():
        return "the folder in which the command was started no longer exists; expected an existing one: cd to it"
    if isinstance(error, OSError):
        from hmtb_twin.files.errors import system_reason

        where = f" {error.filename!r}" if error.filename else ""
        return f"cannot read or write{where}: {system_reason(error)}"
    return None


def _has_working_folder() -> bool:
    try:
        os.getcwd()
    except FileNotFoundError:
        return False
    return True


def _is_out_of_memory(error: Exception) -> bool:
    """Whether memory ran out: libraries say so in errors of their own."""
    if isinstance(error, MemoryError):
        return True
    # A shared library that cannot be mapped, and MuJoCo's own error.
    words = {"ImportError": "failed to map", "FatalError": "allocate memory"}.get(type(error).__name__)
    return words is not None and words in str(error)

"""Options of commands, read by tyro: help texts, and one line for words that a command does not take."""

import contextlib
import functools
import inspect
import io
import os
import re
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, ParamSpec, get_args, get_origin

import tyro

from scenarios.files.errors import ScenarioError

MESSAGE = r"Missing (from|value)|Error parsing|Unrecognized options?:|[Ii]nvalid choice '"
"""Beginnings of the parser's messages."""

KINDS = {"INT": "a whole number", "FLOAT": "a number", "[INT [INT ...]]": "whole numbers", "PATH": "a path"}
"""Words for the parser's kinds of values."""

STRAY = {
    "hmtb waveform": "--path",
    "hmtb video": "--out",
    "hmtb thesis": "--out",
}
"""The option that a surplus word was probably meant for, by command."""

ADVICE = {
    ("several-intervals", "dt"): "--dt",
    ("no-interval", "dt"): "or --dt SECONDS",
    ("no-interval", "time"): "--time NAME",
    ("several-times", "time"): "--time NAME",
    ("not-a-number", "time_unit"): ", or in --time-unit",
    ("lost-samples", "missing"): "; --missing takes NaN or empty cells among outputs",
    ("other-channels", "names"): "; read the record as that of the model, by --input and --output or by --joint",
}
"""Advice on options of commands, by the code of the analyst's message and the argument that it advises."""

Options = ParamSpec("Options")


def listing(program: str, description: str, commands: Mapping[str, str]) -> str:
    """The help of a program that has commands: its description, and each command with the first line of its help.

    Args:
        program: Its name, e.g. ``"hmtb"``.
        description: Its text.
        commands: Texts of the help of the commands by their names.
    """
    width = max(map(len, commands)) + 4
    columns = max(shutil.get_terminal_size().columns, 2 * width)
    lines = [f"usage: {program} COMMAND [OPTIONS]", "", description.rstrip(), "", "Commands:", ""]
    for name, text in commands.items():
        summary = text.partition("\n")[0]
        first, others = f"  {name}".ljust(width), " " * width
        lines += textwrap.wrap(summary, columns, initial_indent=first, subsequent_indent=others)
    lines += ["", f"Options and examples: {program} COMMAND --help. Release: hmtb --version."]
    lines += ["Exit codes: 0 done, 1 a check found a difference, 2 bad input, 130 interrupted."]
    return "\n".join(lines) + "\n"


def read_options(command: Callable[Options, int], program: str, words: Sequence[str]) -> functools.partial[int] | str:
    """The command with its options, ready to run, or its help.

    Args:
        command: Function whose parameters are the options and whose docstring is the help.
        program: Words that call it, e.g. ``"hmtb identify"``.
        words: Words behind these.

    Raises:
        ScenarioError: The command does not take the words.
    """

    @functools.wraps(command)
    def fill(*args: Options.args, **kwargs: Options.kwargs) -> functools.partial[int]:
        return functools.partial(command, *args, **kwargs)

    signature = inspect.signature(command)
    options = [each.replace(annotation=_option(each.annotation)) for each in signature.parameters.values()]
    fill.__signature__ = signature.replace(parameters=options)  # type: ignore[attr-defined]
    fill.__annotations__ = {each.name: each.annotation for each in options}
    del fill.__wrapped__  # the parser would read the wrapped function
    # The parser keeps some line breaks of docstrings, so all go that stand inside a paragraph or an option.
    fill.__doc__ = re.sub(r"(?<=\S)\n(?: {8})?(?=\S)", " ", inspect.cleandoc(command.__doc__ or ""))
    asks_help = not {"-h", "--help"}.isdisjoint(words)
    # The parser draws its boxes as far as the encoding of the output allows.
    out, err = io.TextIOWrapper(io.BytesIO(), encoding=sys.stdout.encoding or "utf-8"), io.StringIO()
    # So many columns that no message is wrapped, which is then read line by line; no help fits into fewer than 40.
    width = _columns(str(max(shutil.get_terminal_size().columns, 40)) if asks_help else "100000")
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), width:
            config = (tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff)
            call: functools.partial[int] = tyro.cli(fill, prog=program, args=words, config=config)
            return call
    except SystemExit as leaving:
        if leaving.code:
            raise ScenarioError(f"{_objection(err.getvalue(), program)}; see {program} --help") from None
        out.seek(0)
        return _wrapped(out.read())


def command_line(program: str, command: Callable[..., int], values: Mapping[str, Any]) -> str:
    """The words that run a command with these values; options with their defaults are left out.

    Args:
        program: Words that call it, e.g. ``"hmtb identify"``.
        command: Its function: parameters before the star are words, others options.
        values: By name of the parameter.
    """
    words = program.split()
    for name, parameter in inspect.signature(command).parameters.items():
        value = values.get(name, parameter.default)
        if value == parameter.default:
            continue
        words += [] if parameter.kind is parameter.POSITIONAL_OR_KEYWORD else [f"--{name.replace('_', '-')}"]
        words += [] if value is True else [str(one) for one in (value if isinstance(value, tuple) else (value,))]
    return shlex.join(words)


def in_options(text: str, error: BaseException, command: Callable[..., int]) -> str:
    """The text of an error with advice on options of a command in place of the analyst's advice on arguments.

    Advice on an option that the command lacks is left out.

    Args:
        text: The text.
        error: The error: its own advice counts, and that of the errors behind it, which it may quote.
        command: Function of the command.
    """
    options = {f"--{name.replace('_', '-')}" for name in inspect.signature(command).parameters}
    cause: BaseException | None = error
    while cause is not None:
        advice: Mapping[str, str] = getattr(cause, "advice", {})
        if advice:
            from sysid.records.errors import reworded  # loaded already: the error is one of the package's own

            words = {argument: ADVICE.get((cause.code, argument), "") for argument in advice}  # type: ignore[attr-defined]
            taken = {name: text for name, text in words.items() if options.issuperset(re.findall(r"--[\w-]+", text))}
            text = reworded(text, advice, taken)
        cause = cause.__cause__
    return text


def completion_script(
    shell: str,
    groups: Mapping[str, Sequence[str]],
    commands: Mapping[str, Callable[..., int]],
    known: Mapping[str, Sequence[str]],
) -> str:
    """A script that completes `hmtb` in bash, zsh or fish.

    tyro's own scripts complete no words without an option, neither names of scenarios nor files.

    Args:
        shell: One of the three.
        groups: Commands of each program: "" and "dataset".
        commands: Functions of the commands by the words behind `hmtb`.
        known: Names by the word for them in help texts, e.g. ``"SCENARIO"``.
    """
    from jinja2 import Environment, PackageLoader

    tables = {}
    for words, command in commands.items():
        parameters = inspect.signature(command).parameters.values()
        options = [one for one in parameters if one.kind is one.KEYWORD_ONLY]
        flag = {one.name: f"--{one.name.replace('_', '-')}" for one in options}
        tables[words] = {
            "summary": (command.__doc__ or "").partition("\n")[0].rstrip("."),
            "words": [value for one in parameters if one not in options for value in _values(one.annotation, known)],
            "flags": [flag[one.name] for one in options if one.annotation is bool] + ["--help"],
            "lists": [flag[one.name] for one in options if "tuple[" in str(one.annotation)],
            "values": {flag[one.name]: _values(one.annotation, known) for one in options if one.annotation is not bool},
        }
    templates = Environment(loader=PackageLoader("scenarios"), trim_blocks=True, lstrip_blocks=True)
    template = templates.get_template(f"completion.{'fish' if shell == 'fish' else 'bash'}.j2")
    return template.render(shell=shell, groups=groups, commands=tables)


def _values(kind: Any, known: Mapping[str, Sequence[str]]) -> list[str]:
    """Words that an argument takes, as its type or its word in help texts names them; none where any may stand."""
    kind, *settings = (kind.__origin__, *kind.__metadata__) if get_origin(kind) is Annotated else (kind,)
    literals = [one for one in (kind, *get_args(kind)) if get_origin(one) is Literal]
    metavars = [text for one in settings if (text := getattr(one, "metavar", None))]
    names = [name for text in metavars for name in re.findall(r"[\w.]+", text) if "|" in text or name in known]
    words = [word for name in names for word in known.get(name, [name] if re.fullmatch(r"[a-z]\w*", name) else [])]
    return [*(value for one in literals for value in get_args(one)), *words]


def _option(kind: Any) -> Any:
    """The annotation of an option, with a help text in which None and empty defaults do not appear."""
    kind, *settings = (kind.__origin__, *kind.__metadata__) if get_origin(kind) is Annotated else (kind,)
    metavar = None
    if type(None) in get_args(kind):
        (value,) = set(get_args(kind)) - {type(None)}
        metavar = "|".join(get_args(value)) if get_origin(value) is Literal else value.__name__.upper()
    return Annotated[(kind, tyro.conf.arg(metavar=metavar, help_behavior_hint=_default), *settings)]


def _default(value: str) -> str:
    return "" if value in ("None", "", "''") else f"(default: {value})"


@contextlib.contextmanager
def _columns(count: str) -> Iterator[None]:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = count
    try:
        yield
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before


def _wrapped(text: str) -> str:
    """Wrap the paragraphs of a help text, one line each as the parser prints it; boxes and examples stay."""
    columns = shutil.get_terminal_size().columns
    lines: list[str] = []
    for line in text.splitlines():
        prose = len(line) > columns and line[0].isalnum() and not line.startswith("usage:")
        lines += textwrap.wrap(line, columns, break_on_hyphens=False) if prose else [line]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def _objection(text: str, command: str) -> str:
    """The parser's message in one line: what was given, what was expected."""
    plain = (line.strip("│|╭╮╰╯+ \t") for line in re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines())
    rows = [row for row in plain if row.strip("─- ")]
    message = next((row for row in rows if re.match(MESSAGE, row)), "; ".join(rows[:2]))
    if message.startswith("Missing from"):
        # Each option stands above its help text, which ends in "(required)".
        needed = [row.partition(" ") for row, help_text in pairwise(rows) if help_text.endswith("(required)")]
        return "missing " + ", ".join(f"{name} ({KINDS.get(kind, kind)})" if kind else name for name, _, kind in needed)
    if match := re.match(r"Missing value for argument '([^']+)'", message):
        return f"{match[1]} needs a value"
    if match := re.match(r"Error parsing ([^:]+): (.*)", message):
        given = " ".join(re.findall(r"'([^']*)'", match[2])) or "something else"
        usage = next((row for row in rows if row.startswith(match[1].split("/")[-1] + " ")), "")
        kind = usage.partition(" ")[2]
        return f"{match[1]}: expected {KINDS.get(kind, kind) or 'another value'}, given {given}"
    if match := re.match(r"Unrecognized options?: (.*)", message):
        words = match[1].replace(", ", " ")
        if not words.startswith("-"):
            meant = f"; did you mean {STRAY[command]} {words}?" if command in STRAY and " " not in words else ""
            return f"unexpected argument{'s' if ' ' in words else ''} {words!r}{meant}"
        close = [row.split()[0] for row in rows if row.startswith("--") and row != message]
        return f"unknown option {words.split()[0]!r}" + (f": did you mean {close[0]}?" if close else "")
    if match := re.match(r"[Ii]nvalid choice '([^']*)' for argument '([^']*)'. Expected one of \((.*)\)", message):
        # The parser names the choices of some options in no fixed order.
        choices = sorted(match[3].replace("'", "").removesuffix(", None").rstrip(",").split(", "))
        return f"unknown {match[2]} {match[1]!r}; there are: {', '.join(choices)}"
    return message or "cannot read the command"

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
from scenarios.files.option_values import option_values

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
    ("counter", "dt"): "--dt SECONDS",
    ("no-interval", "time"): "--time NAME",
    ("several-times", "time"): "--time NAME",
    ("not-a-number", "time_unit"): ", or in --time-unit",
    ("lost-samples", "missing"): "; --missing takes NaN or empty cells among outputs",
    ("lost-inputs", "missing"): "; --missing takes these rows for lost ones",
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
    # On a terminal narrower than that, the summaries would stand one letter below the other.
    columns = max(shutil.get_terminal_size().columns, 2 * width)
    lines = [f"usage: {program} COMMAND [OPTIONS]", "", description.rstrip(), "", "Commands:", ""]
    for name, help_text in commands.items():
        summary = help_text.partition("\n")[0]
        indent = f"  {name}".ljust(width)
        lines += textwrap.wrap(summary, columns, initial_indent=indent, subsequent_indent=" " * width)
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
    parameters = [p.replace(annotation=_with_help(p.annotation)) for p in signature.parameters.values()]
    fill.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    fill.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del fill.__wrapped__  # the parser would read the wrapped function
    # The parser keeps some line breaks of docstrings, so all go that stand inside a paragraph or an option.
    fill.__doc__ = re.sub(r"(?<=\S)\n(?: {8})?(?=\S)", " ", inspect.cleandoc(command.__doc__ or ""))
    asks_help = not {"-h", "--help"}.isdisjoint(words)
    # The parser draws its boxes as far as the encoding of the output allows.
    out, err = io.TextIOWrapper(io.BytesIO(), encoding=sys.stdout.encoding or "utf-8"), io.StringIO()
    # So many columns that no message is wrapped, which is then read line by line; no help fits into fewer than 40.
    columns = max(shutil.get_terminal_size().columns, 40) if asks_help else 100_000
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), _columns(columns):
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
        if parameter.kind is not parameter.POSITIONAL_OR_KEYWORD:
            words.append(f"--{name.replace('_', '-')}")
        words += option_values(value)
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

    tables = {words: _completions(command, known) for words, command in commands.items()}
    templates = Environment(loader=PackageLoader("scenarios"), trim_blocks=True, lstrip_blocks=True)
    # zsh runs the completions of bash.
    syntax = "fish" if shell == "fish" else "bash"
    template = templates.get_template(f"completion.{syntax}.j2")
    return template.render(shell=shell, groups=groups, commands=tables)


def _completions(command: Callable[..., int], known: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """What the templates of the scripts need of a command: summary, words, flags, and values of its options."""
    parameters = inspect.signature(command).parameters.values()
    words: list[str] = []
    flags: list[str] = []
    lists: list[str] = []
    values: dict[str, list[str]] = {}
    for parameter in parameters:
        if parameter.kind is not parameter.KEYWORD_ONLY:
            words += _choices(parameter.annotation, known)
            continue
        option = f"--{parameter.name.replace('_', '-')}"
        if parameter.annotation is bool:
            flags.append(option)
        else:
            values[option] = _choices(parameter.annotation, known)
        if "tuple[" in str(parameter.annotation):
            lists.append(option)
    summary = (command.__doc__ or "").partition("\n")[0].rstrip(".")
    return {"summary": summary, "words": words, "flags": [*flags, "--help"], "lists": lists, "values": values}


def _choices(annotation: Any, known: Mapping[str, Sequence[str]]) -> list[str]:
    """Words that an argument takes, as its type or its word in help texts names them; none where any may stand."""
    annotation, settings = _type_and_settings(annotation)
    words: list[str] = []
    for alternative in (annotation, *get_args(annotation)):
        if get_origin(alternative) is Literal:
            words += get_args(alternative)
    for setting in settings:
        metavar = getattr(setting, "metavar", None) or ""
        for name in re.findall(r"[\w.]+", metavar):
            if name in known:
                words += known[name]
            elif "|" in metavar and re.fullmatch(r"[a-z]\w*", name):  # a choice; capitals stand for something
                words.append(name)
    return words


def _with_help(annotation: Any) -> Any:
    """The annotation of an option, with a help text in which None and empty defaults do not appear."""
    value_type, settings = _type_and_settings(annotation)
    metavar = None
    if type(None) in get_args(value_type):
        (given_type,) = set(get_args(value_type)) - {type(None)}
        is_choice = get_origin(given_type) is Literal
        metavar = "|".join(get_args(given_type)) if is_choice else given_type.__name__.upper()
    return Annotated[(value_type, tyro.conf.arg(metavar=metavar, help_behavior_hint=_default), *settings)]


def _type_and_settings(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Type of an argument, and what else its annotation tells the parser."""
    if get_origin(annotation) is Annotated:
        return annotation.__origin__, annotation.__metadata__
    return annotation, ()


def _default(value: str) -> str:
    return "" if value in ("None", "", "''") else f"(default: {value})"


@contextlib.contextmanager
def _columns(count: int) -> Iterator[None]:
    """Set the width of the terminal as libraries see it."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = str(count)
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
        is_prose = len(line) > columns and line[0].isalnum() and not line.startswith("usage:")
        lines += textwrap.wrap(line, columns, break_on_hyphens=False) if is_prose else [line]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def _objection(output: str, program: str) -> str:
    """The parser's message in one line: what was given, what was expected."""
    without_colours = re.sub(r"\x1b\[[0-9;]*m", "", output)
    lines = [line.strip("│|╭╮╰╯+ \t") for line in without_colours.splitlines()]  # without the sides of its boxes
    rows = [line for line in lines if line.strip("─- ")]
    message = next((row for row in rows if re.match(MESSAGE, row)), "; ".join(rows[:2]))
    if message.startswith("Missing from"):
        return _missing_options(rows)
    if match := re.match(r"Missing value for argument '([^']+)'", message):
        return f"{match[1]} needs a value"
    if match := re.match(r"Error parsing ([^:]+): (.*)", message):
        return _unreadable_value(match[1], match[2], rows)
    if match := re.match(r"Unrecognized options?: (.*)", message):
        listed = [row.split()[0] for row in rows if row.startswith("--") and row != message]
        return _unknown_words(match[1].replace(", ", " "), program, listed)
    if match := re.match(r"[Ii]nvalid choice '([^']*)' for argument '([^']*)'. Expected one of \((.*)\)", message):
        # The parser names the choices of some options in no fixed order.
        choices = sorted(match[3].replace("'", "").removesuffix(", None").rstrip(",").split(", "))
        return f"unknown {match[2]} {match[1]!r}; there are: {', '.join(choices)}"
    return message or "cannot read the command"


def _missing_options(rows: Sequence[str]) -> str:
    """The required options that are missing: each stands above its help text, which ends in "(required)"."""
    needed = []
    for row, help_text in pairwise(rows):
        if help_text.endswith("(required)"):
            name, _, metavar = row.partition(" ")
            kind = f" ({KINDS.get(metavar, metavar)})" if metavar else ""
            needed.append(f"{name}{kind}")
    return f"missing {', '.join(needed)}"


def _unreadable_value(argument: str, reason: str, rows: Sequence[str]) -> str:
    """A value of the wrong type; its usage line names the type."""
    value = " ".join(re.findall(r"'([^']*)'", reason)) or "something else"
    option = argument.split("/")[-1]  # the last of several spellings
    usage = next((row for row in rows if row.startswith(f"{option} ")), "")
    metavar = usage.partition(" ")[2]
    return f"{argument}: expected {KINDS.get(metavar, metavar) or 'another value'}, given {value}"


def _unknown_words(words: str, program: str, similar: Sequence[str]) -> str:
    """Words that the command does not take, with the option that was probably meant."""
    if words.startswith("-"):
        hint = f": did you mean {similar[0]}?" if similar else ""
        return f"unknown option {words.split()[0]!r}{hint}"
    is_single = " " not in words
    hint = f"; did you mean {STRAY[program]} {words}?" if is_single and program in STRAY else ""
    noun = "argument" if is_single else "arguments"
    return f"unexpected {noun} {words!r}{hint}"

"""What was done on a page as a command line, as Python, and as a TOML file, which do the same elsewhere."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from inspect import signature

from scenarios.experiments.excitation import KINDS
from scenarios.experiments.excitation_computer import FILE, SETTINGS, Excitation
from scenarios.experiments.registry import registered
from scenarios.experiments.scenario import Scenario


@dataclass(frozen=True)
class Recipe:
    """The same without the page.

    Attributes:
        commands: Words of each command, `hmtb` first.
        python: A program.
        toml: Text of a scenario file; empty where there is none.
        file: Name of that file.
    """

    commands: Sequence[Sequence[str]]
    python: str
    toml: str = ""
    file: str = ""

    @property
    def shell(self) -> str:
        """The command lines, quoted for the shell, one on each line."""
        return "\n".join(shlex.join(words) for words in self.commands)


def excitation_recipe(excitation: Excitation, file: str) -> Recipe:
    """Return the command and the Python code that reproduce an excitation; points of a user's own come from a file."""
    lines = ["from scenarios.experiments import Excitation"]
    lines += ["from scenarios.experiments.excitation_review import excitation_summary"]
    arguments = signature(KINDS[excitation.kind]).parameters
    changed = {name: value for name, value in excitation.parameters.items() if value != arguments[name].default}
    settings = {name: value for name in SETTINGS if (value := getattr(excitation, name)) is not None}
    parameters, options = repr(changed), {**changed, **settings}
    options.pop("iterations", None)  # the command shows one period
    if excitation.kind == "points":
        parameters, options["path"] = f'{{"points": read_points({file!r})}}', file
        del options["points"]
        lines += ["from scenarios.experiments.waveform import read_points"]
    words = ["hmtb", "waveform", kind_word(excitation.kind)]
    for name, value in options.items():
        # In one word: a value may begin with a minus sign.
        option = f"--{name.replace('_', '-')}"
        words.append(option if value is True else f"{option}={value}")
    call = ", ".join([repr(excitation.kind), parameters, *(f"{name}={value!r}" for name, value in settings.items())])
    lines += ["", f"excitation = Excitation({call})"]
    lines += ["print(excitation.waveform().points)", "print(excitation_summary(excitation))"]
    return Recipe([words], "\n".join(lines))


def kind_word(kind: str) -> str:
    """The word for a kind that commands take."""
    return FILE if kind == "points" else kind


def scenario_recipe(scenario: Scenario) -> Recipe:
    """The run of a scenario without the page."""
    table = registered().get(scenario.name)
    # A registered scenario that was changed on the page goes by a file of its own.
    is_registered = table is not None and Scenario.from_table(table) == scenario
    source = scenario.name if is_registered else f"{scenario.name}.toml"
    return Recipe(
        commands=(("hmtb", "preview", source), ("hmtb", "simulate", source)),
        python=(
            "import hmtb_twin, scenarios\n\n"
            f'scenario = scenarios.load("{source}")\n'
            "(log,) = hmtb_twin.simulate([scenario])\n"
            f'log.save("{scenario.name}.nc")'
        ),
        toml=scenario.to_toml(),
        file=f"{scenario.name}.toml",
    )

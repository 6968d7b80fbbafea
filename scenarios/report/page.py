"""Pages from templates: figures are numbered and sections listed as they are rendered; numbers get minus signs."""

import re
from collections.abc import Callable, Mapping

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape


class Page:
    """A page of which several templates are parts.

    Templates call its methods as `page.part`, `page.section` and `page.number`; the macros of `macros.html.j2` do so.

    Attributes:
        contents: Parts of the page in their order, by name, each with the marks and headings of its sections; a part
            without sections is left out when templates iterate over it.
    """

    def __init__(self, filters: Mapping[str, Callable[..., object]] | None = None) -> None:
        self.contents: list[tuple[str, list[tuple[str, str]]]] = [("", [])]
        self._numbers: dict[str, int] = {}
        self._environment = Environment(
            loader=PackageLoader("scenarios"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            keep_trailing_newline=True,
            finalize=signed,
        )
        self._environment.globals["page"] = self
        # Markup keeps its hyphens: commands, and attributes that a script reads.
        self._environment.filters.update({"verbatim": escape, **(filters or {})})

    def render(self, template: str, context: Mapping[str, object]) -> Markup:
        """Render a template of this package."""
        return Markup(self._environment.get_template(template).render(context))

    def number(self, name: str) -> int:
        """Number of a figure: its place on the page among those that were rendered before."""
        return self._numbers.setdefault(name, len(self._numbers) + 1)

    def part(self, name: str) -> str:
        """Begin a part of the page; return its name."""
        self.contents.append((name, []))
        return name

    def section(self, mark: str, heading: str) -> str:
        """Begin a section; return its mark."""
        self.contents[-1][1].append((mark, heading))
        return mark


def signed(value: object) -> object:
    """The value of an expression in a template, with true minus signs before its numbers; markup stays as it is."""
    # A hyphen after a word, a number or a bracket joins or subtracts; it is no sign.
    if isinstance(value, str | float | int) and not isinstance(value, Markup | bool):
        return re.sub(r"(?<![\w.)\]-])-(?=\d)", "−", str(value))
    return value

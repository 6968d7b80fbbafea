"""Results as text and as HTML: numbers to the digits of their uncertainty, tables, polynomials, poles."""

import html
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LISTED = 21  # rows of a printed table, as many as lags 0 to 20; longer ones are shown in part
WIDEST = 10  # columns of a printed matrix, likewise
PATHS = 4  # tables of a printed result over time or frequency, one for each path from input to output
AT_ZERO = 1e-9  # modulus of a pole in the z plane below which it is a delay
WIDTH = 120  # characters of a printed line


@dataclass(frozen=True)
class Table:
    """Cells under headings; the first column says what a row is. Columns without heading are texts, aligned left.

    Attributes:
        columns: Heading and cells of each.
    """

    columns: Sequence[tuple[str, Sequence[str]]]

    def text(self) -> str:
        """Lines with aligned columns, a part of them where there are many."""
        columns = [[head, *(cells[k] for k in self._listed())] for head, cells in self.columns]
        widths = [max(map(len, column)) for column in columns]
        sides = [str.rjust if k and column[0] else str.ljust for k, column in enumerate(columns)]
        padded = [
            [side(cell, width) for cell in column] for side, column, width in zip(sides, columns, widths, strict=True)
        ]
        lines = ["  ".join(row).rstrip() for row in zip(*padded, strict=True)]
        return "\n".join((*lines[0 if lines[0] else 1 :], *self._left_out()))

    def html(self) -> str:
        """The same as an HTML table, texts escaped."""
        head = "".join(f"<th>{html.escape(name)}</th>" for name, _ in self.columns)
        rows = ("".join(f"<td>{html.escape(cells[k])}</td>" for _, cells in self.columns) for k in self._listed())
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<table><tr>{head}</tr>{body}</table>" + "".join(f"<p>{line}</p>" for line in self._left_out())

    def _listed(self) -> NDArray[np.int_]:
        return spaced(len(self.columns[0][1]))

    def _left_out(self) -> list[str]:
        rows = len(self.columns[0][1])
        return [f"({LISTED} of {rows} rows)"] if rows > LISTED else []


Part = str | Table
"""A paragraph or a table."""


def spaced(count: int, most: int = LISTED) -> NDArray[np.int_]:
    """Indices of at most `most` evenly spaced rows, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def as_text(parts: Iterable[Part]) -> str:
    """Lines of a printed result, indented below the first paragraph."""
    first, *rest = (part if isinstance(part, str) else part.text() for part in parts)
    return "\n".join((first, *(textwrap.indent(text, "  ") for text in rest if text)))


def as_html(parts: Iterable[Part], figure: str = "") -> str:
    """The same for a notebook, beside a figure."""
    pre = '<pre style="white-space:pre-wrap">'
    shown = (f"{pre}{html.escape(part)}</pre>" if isinstance(part, str) else part.html() for part in parts if part)
    style = "display:flex;flex-wrap:wrap;align-items:flex-start;gap:1em"
    return f'<div style="{style}"><div>{"".join(shown)}</div>{figure}</div>'


def number(value: Any) -> str:
    """A number with five digits, a dash for NaN; complex ones as a + bj."""
    if isinstance(value, bool | np.bool_ | int | np.integer | str):
        return str(value)
    if isinstance(value, complex | np.complexfloating):
        return f"{value.real:.4g}{value.imag:+.4g}j" if value.imag else f"{value.real:.4g}"
    return "–" if np.isnan(value) else f"{value + 0.0:.5g}"


def counted(count: int, what: str) -> str:
    """A number of things: 1 sample, 2 samples."""
    return f"{count} {what}{'s' * (count != 1)}"


def numbers(values: ArrayLike) -> list[str]:
    """The numbers of an array (n,)."""
    return [number(value) for value in np.asarray(values)]


def uncertain(values: ArrayLike, deviations: ArrayLike) -> list[str]:
    """Values ± standard deviations (n,), both to the second digit of the deviation."""
    return [_uncertain(*pair) for pair in zip(np.ravel(values), np.ravel(deviations), strict=True)]


def _uncertain(value: float, deviation: float) -> str:
    if not 0.0 < deviation < np.inf or not np.isfinite(value):
        return number(value)
    last = int(np.floor(np.log10(deviation)))
    if last >= -5 and max(abs(value), deviation) < 1e7:
        digits = max(1 - last, 0)
        return f"{round(value, digits) + 0.0:.{digits}f} ± {deviation:.{digits}f}"
    size = int(np.floor(np.log10(abs(value)))) if value else last
    return f"{value:#.{min(max(size - last + 2, 2), 7)}g} ± {deviation:#.2g}"


def matrix_table(name: str, values: NDArray[Any], rows: Sequence[str], columns: Sequence[str]) -> Table:
    """A matrix with names of its rows and columns, some of them where there are many."""
    listed = spaced(len(columns), WIDEST)
    part = f" ({WIDEST} of {len(columns)} columns)" if len(columns) > WIDEST else ""
    return Table([(f"{name}{part}", rows), *((columns[j], numbers(values[:, j])) for j in listed)])


def polynomial(name: str, coefficients: ArrayLike) -> str:
    """Coefficients of falling powers 1, q^-1, q^-2, ... as a sum, on lines that break between its terms."""
    terms = [(float(c), k) for k, c in enumerate(np.asarray(coefficients)) if c]
    signs = [("-" if c < 0.0 else "+") + f"\xa0{number(abs(c))}" + (f"\xa0q^-{k}" if k else "") for c, k in terms]
    text = " ".join(signs).removeprefix("+\xa0") or "0"
    lines = textwrap.wrap(f"{name}(q) = {text}", WIDTH, subsequent_indent=" " * (len(name) + 6), max_lines=4)
    return "\n".join(lines).replace("\xa0", " ")


def poles_table(poles: NDArray[np.complex128], dt: float) -> Table:
    """Poles in the z plane with natural frequency, damping ratio and time constant of s = log(z) / dt; pairs once."""
    zero = np.abs(poles) <= AT_ZERO
    upper = poles[(poles.imag >= 0.0) & ~zero].astype(complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log(upper) / dt
        columns = (np.abs(s) / (2.0 * np.pi), -s.real / np.abs(s), -1.0 / s.real)
    roots = [f"{number(z.real)} ± {number(z.imag)}j" if z.imag else number(z.real) for z in upper]
    count = int(zero.sum())
    delays = [f"0 ({count} times)" if count > 1 else "0"] if count else []
    heads = ("natural frequency / Hz", "damping", "time constant / s")
    cells = [(head, [*numbers(values), *("–" for _ in delays)]) for head, values in zip(heads, columns, strict=True)]
    return Table([("pole (z plane)", [*roots, *delays]), *cells])


def tables(variables: Mapping[str, Any], coordinates: Mapping[str, Any]) -> list[Part]:
    """A table over the first axis for all labels of the other axes; values ± their deviations, complex ones left out.

    Args:
        variables: Arrays by name as (tuple of axes, values, attributes), deviations with the name NAME_deviation.
        coordinates: Labels of every axis, or (axis, values, attributes); the first axis is that of the rows.
    """
    (axis, first), *others = coordinates.items()
    _, points, attributes = first if isinstance(first, tuple) else (axis, first, {})
    points = np.asarray(points)
    rows = spaced(len(points))
    if axis == "frequency" and len(rows) < len(points):
        spread = np.searchsorted(points, np.geomspace(points[points > 0.0].min(), points.max(), len(rows)))
        rows = np.unique(np.minimum(spread, len(points) - 1))
    paths = list(np.ndindex(*(len(labels) for _, labels in others)))
    parts: list[Part] = []
    for path in paths[:PATHS]:
        place = {name: k for (name, _), k in zip(others, path, strict=True)}
        parts += [", ".join(f"{name} {labels[place[name]]}" for name, labels in others)] if others else []
        columns = [(_with_unit(axis, attributes), numbers(points[rows]))]
        for name, (axes, values, *further) in variables.items():
            if np.iscomplexobj(values) or name.endswith("_deviation"):
                continue
            entries = (rows, *(place[other] for other in axes[1:]))
            cells, errors = np.asarray(values)[entries], variables.get(f"{name}_deviation")
            head = _with_unit(name.replace("_", " "), *further)
            columns.append((head, numbers(cells) if errors is None else uncertain(cells, errors[1][entries])))
        parts.append(Table(columns))
    parts += [f"... {len(paths)} tables, all in to_dataframe()"] if len(paths) > PATHS else []
    return parts + ([f"({len(rows)} of {len(points)} rows)"] if len(rows) < len(points) else [])


def _with_unit(name: str, attributes: Mapping[str, Any] = MappingProxyType({})) -> str:
    return f"{name} / {attributes['units']}" if attributes.get("units") else name


def fields_table(fields: Mapping[str, Any]) -> list[Part]:
    """A table of names and values; long arrays by their shape and range."""
    values = {
        name.replace("_", " "): textwrap.shorten(brief(value, 16), WIDTH, placeholder=" ...")
        for name, value in fields.items()
        if value is not None and not (isinstance(value, tuple) and not value)
    }
    return [Table([("", list(values)), ("", list(values.values()))])] if values else []


def brief(value: Any, most: int) -> str:
    """A value on one line: arrays of up to `most` entries in full, others by shape and range, long tuples by length."""
    if isinstance(value, np.ndarray):
        shape = " x ".join(map(str, value.shape))
        if value.size == 1:
            return number(value.item())
        if 1 < value.size <= most and value.ndim <= 2:
            return "[" + "; ".join(", ".join(numbers(row)) for row in np.atleast_2d(value)) + "]"
        if value.dtype.kind not in "biuf" or not np.isfinite(value).any():
            return f"<{shape}>"
        return f"<{shape}, {number(np.nanmin(value))} to {number(np.nanmax(value))}>"
    if isinstance(value, tuple):
        plain = len(value) <= most and all(isinstance(part, str | float | int | np.ndarray) for part in value)
        return f"({', '.join(brief(part, most) for part in value)})" if plain else f"<{len(value)}>"
    if isinstance(value, Mapping):
        return f"<{len(value)}>"
    if isinstance(value, str | int | float | complex | np.generic):
        return repr(value) if isinstance(value, str) else number(value)
    return textwrap.shorten(repr(value), WIDTH, placeholder=" ...")

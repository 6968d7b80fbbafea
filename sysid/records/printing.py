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
        listed = self._listed()
        padded = []
        for position, (head, cells) in enumerate(self.columns):
            column = [head, *(cells[k] for k in listed)]
            width = max(map(len, column))
            # Numbers stand under their heading; the names of the rows and texts begin on the left.
            is_of_numbers = position > 0 and head
            padded.append([cell.rjust(width) if is_of_numbers else cell.ljust(width) for cell in column])
        lines = ["  ".join(row).rstrip() for row in zip(*padded, strict=True)]
        # Columns without headings have no first line.
        shown = lines if lines[0] else lines[1:]
        return "\n".join((*shown, *self._left_out()))

    def html(self) -> str:
        """The same as an HTML table, texts escaped."""
        head = "".join(f"<th>{html.escape(name)}</th>" for name, _ in self.columns)
        body = ""
        for k in self._listed():
            row = "".join(f"<td>{html.escape(cells[k])}</td>" for _, cells in self.columns)
            body += f"<tr>{row}</tr>"
        remarks = "".join(f"<p>{line}</p>" for line in self._left_out())
        return f"<table><tr>{head}</tr>{body}</table>{remarks}"

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
    first, *rest = [item if isinstance(item, str) else item.text() for item in parts]
    return "\n".join((first, *(textwrap.indent(paragraph, "  ") for paragraph in rest if paragraph)))


def as_html(parts: Iterable[Part], figure: str = "") -> str:
    """HTML of a printed result for a notebook, with a figure."""
    shown = ""
    for item in parts:
        if isinstance(item, str) and not item:
            continue
        if isinstance(item, str):
            shown += f'<pre style="white-space:pre-wrap">{html.escape(item)}</pre>'
        else:
            shown += item.html()
    style = "display:flex;flex-wrap:wrap;align-items:flex-start;gap:1em"
    return f'<div style="{style}"><div>{shown}</div>{figure}</div>'


def number(value: Any) -> str:
    """A number with five digits, a dash for NaN; complex ones as a + bj."""
    if isinstance(value, bool | np.bool_ | int | np.integer | str):
        return str(value)
    if isinstance(value, complex | np.complexfloating):
        return f"{value.real:.4g}{value.imag:+.4g}j" if value.imag else f"{value.real:.4g}"
    return "–" if np.isnan(value) else f"{value + 0.0:.5g}"


def counted(count: int, noun: str) -> str:
    """A number of things: 1 sample, 2 samples."""
    return f"{count} {noun}{'s' * (count != 1)}"


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
    digits = min(max(size - last + 2, 2), 7)
    return f"{value:#.{digits}g} ± {deviation:#.2g}"


def matrix_table(name: str, values: NDArray[Any], rows: Sequence[str], columns: Sequence[str]) -> Table:
    """A matrix with names of its rows and columns, some of them where there are many."""
    listed = spaced(len(columns), WIDEST)
    remark = f" ({WIDEST} of {len(columns)} columns)" if len(columns) > WIDEST else ""
    return Table([(f"{name}{remark}", rows), *((columns[j], numbers(values[:, j])) for j in listed)])


def polynomial(name: str, coefficients: ArrayLike) -> str:
    """Coefficients of falling powers 1, q^-1, q^-2, ... as a sum, on lines that break between its terms."""
    terms = []
    for power, coefficient in enumerate(np.asarray(coefficients)):
        if coefficient:
            sign = "-" if coefficient < 0.0 else "+"
            # Within a term, spaces that do not break; `textwrap` breaks between terms.
            term = f"{sign}\xa0{number(abs(float(coefficient)))}"
            terms.append(f"{term}\xa0q^-{power}" if power else term)
    total = " ".join(terms).removeprefix("+\xa0") or "0"
    lines = textwrap.wrap(f"{name}(q) = {total}", WIDTH, subsequent_indent=" " * (len(name) + 6), max_lines=4)
    return "\n".join(lines).replace("\xa0", " ")


def poles_table(poles: NDArray[np.complex128], dt: float) -> Table:
    """Poles in the z plane with natural frequency, damping ratio and time constant of s = log(z) / dt; pairs once."""
    zero = np.abs(poles) <= AT_ZERO
    upper = poles[(poles.imag >= 0.0) & ~zero].astype(complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log(upper) / dt
        columns = (np.abs(s) / (2.0 * np.pi), -s.real / np.abs(s), -1.0 / s.real)
    roots = []
    for pole in upper:
        pair = f"{number(pole.real)} ± {number(pole.imag)}j"
        roots.append(pair if pole.imag else number(pole.real))
    heads = ("natural frequency / Hz", "damping", "time constant / s")
    cells = [numbers(values) for values in columns]
    # Poles at zero are delays: their logarithm is infinite.
    if count := int(zero.sum()):
        roots.append(f"0 ({count} times)" if count > 1 else "0")
        for column in cells:
            column.append("–")
    return Table([("pole (z plane)", roots), *zip(heads, cells, strict=True)])


def tables(variables: Mapping[str, Any], coordinates: Mapping[str, Any]) -> list[Part]:
    """A table over the first axis for all labels of the other axes; values ± their deviations, complex ones left out.

    Args:
        variables: Arrays by name as (tuple of axes, values, attributes), deviations with the name NAME_deviation.
        coordinates: Labels of every axis, or (axis, values, attributes); the first axis is that of the rows.
    """
    (axis, first), *path_axes = coordinates.items()
    _, points, attributes = first if isinstance(first, tuple) else (axis, first, {})
    points = np.asarray(points)
    rows = _listed_rows(axis, points)
    paths = list(np.ndindex(*(len(labels) for _, labels in path_axes)))
    printed: list[Part] = []
    for path in paths[:PATHS]:
        indices = {name: k for (name, _), k in zip(path_axes, path, strict=True)}
        if path_axes:
            printed.append(", ".join(f"{name} {labels[indices[name]]}" for name, labels in path_axes))
        first_column = (_with_unit(axis, attributes), numbers(points[rows]))
        printed.append(Table([first_column, *_columns_of_path(variables, rows, indices)]))
    if len(paths) > PATHS:
        printed.append(f"... {len(paths)} tables, all in to_dataframe()")
    if len(rows) < len(points):
        printed.append(f"({len(rows)} of {len(points)} rows)")
    return printed


def _listed_rows(axis: str, points: NDArray[Any]) -> NDArray[np.int_]:
    """Indices of the rows to print: evenly spaced, over frequency by equal ratios."""
    rows = spaced(len(points))
    if axis == "frequency" and len(rows) < len(points):
        wanted = np.geomspace(points[points > 0.0].min(), points.max(), len(rows))
        rows = np.unique(np.minimum(np.searchsorted(points, wanted), len(points) - 1))
    return rows


def _columns_of_path(
    variables: Mapping[str, Any], rows: NDArray[np.int_], indices: Mapping[str, int]
) -> list[tuple[str, list[str]]]:
    """Headings and cells of all real variables, at the indices of the axes behind the first."""
    columns = []
    for name, (axes, values, *further) in variables.items():
        if np.iscomplexobj(values) or name.endswith("_deviation"):
            continue
        selected: Any = (rows, *(indices[axis] for axis in axes[1:]))
        cells = np.asarray(values)[selected]
        deviation = variables.get(f"{name}_deviation")
        shown = numbers(cells) if deviation is None else uncertain(cells, deviation[1][selected])
        columns.append((_with_unit(name.replace("_", " "), *further), shown))
    return columns


def _with_unit(name: str, attributes: Mapping[str, Any] = MappingProxyType({})) -> str:
    return f"{name} / {attributes['units']}" if attributes.get("units") else name


def fields_table(fields: Mapping[str, Any]) -> list[Part]:
    """A table of names and values; long arrays by their shape and range."""
    values: dict[str, str] = {}
    for name, value in fields.items():
        is_empty = isinstance(value, tuple) and not value
        if value is not None and not is_empty:
            values[name.replace("_", " ")] = textwrap.shorten(brief(value, 16), WIDTH, placeholder=" ...")
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
        is_plain = all(isinstance(item, str | float | int | np.ndarray) for item in value)
        if len(value) > most or not is_plain:
            return f"<{len(value)}>"
        return f"({', '.join(brief(item, most) for item in value)})"
    if isinstance(value, Mapping):
        return f"<{len(value)}>"
    if isinstance(value, str | int | float | complex | np.generic):
        return repr(value) if isinstance(value, str) else number(value)
    return textwrap.shorten(repr(value), WIDTH, placeholder=" ...")

"""Code is read at first sight: how much a reader must hold in mind at once, counted and limited.

The limits are near what widely read packages of this field keep (diffrax, scipy.signal, statsmodels, mujoco.sysid,
python-control, xarray). Counts are per 1,000 statements, docstrings left out. They do not measure whether a name or
a comment is good: reading does.
"""

import ast
import io
import tokenize
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path

import pytest

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PACKAGES = ("hmtb_twin", "sysid", "scenarios")
ROOMS = tuple(
    folder.relative_to(ROOT).as_posix()
    for package in PACKAGES
    for folder in sorted((ROOT / package).iterdir())
    if (folder / "__init__.py").exists()
)

COMPREHENSION = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
COMPOUND = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.If, ast.For, ast.While, ast.With, ast.Try)
FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)

LARGEST_COMPREHENSION, LARGEST_STATEMENT = 30, 45
"""Nodes of the syntax tree: names, constants, operators, calls."""

LONGEST_FUNCTION = 50
"""Lines of a body without its docstring."""

PACKAGE_LIMITS = {"heavy": 6.0, "conditional": 8.0, "wide": 15.0}
ROOM_LIMITS = {"heavy": 10.0, "conditional": 12.0, "wide": 20.0}
"""Per 1,000 statements."""

MOST_LONG_FUNCTIONS = 15
LARGEST_SHARE_OF_PRONOUNS = 0.04
SMALLEST_SHARE_OF_COMMENTS = 0.03

PRONOUNS = frozenset(
    [
        *(
            "one",
            "own",
            "entry",
            "entries",
            "part",
            "parts",
            "each",
            "others",
            "other",
            "known",
            "found",
            "given",
            "what",
        ),
        *("whole", "some", "more", "most", "least", "away", "every", "there", "here", "now", "text", "texts", "number"),
        *("numbers", "kind", "place", "places"),
    ]
)
"""Names that do not say what they hold."""


@dataclass
class Density:
    """Counts of what makes code hard to read in some files."""

    statements: int = 0
    heavy: int = 0
    conditional: int = 0
    wide: int = 0
    long_functions: int = 0
    names: int = 0
    pronouns: int = 0
    lines: int = 0
    comment_lines: int = 0

    def per_thousand(self, count: str) -> float:
        """A count per 1,000 statements."""
        return 1000.0 * getattr(self, count) / max(self.statements, 1)

    def add(self, source: str) -> None:
        """Count one file."""
        tree = ast.parse(source)
        self.lines += source.count("\n")
        self.comment_lines += len(lines_with_comments(source))
        alone = conditionals_alone(tree)
        sizes = sizes_of(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.stmt) and not is_docstring(node):
                self.statements += 1
                self.wide += not isinstance(node, COMPOUND) and sizes[node] > LARGEST_STATEMENT
            if isinstance(node, COMPREHENSION):
                self.heavy += is_heavy(node, sizes[node])
            if isinstance(node, ast.IfExp):
                self.conditional += node not in alone
            if isinstance(node, FUNCTION):
                self.long_functions += body_lines(node) > LONGEST_FUNCTION
            name = bound_name(node)
            if name is not None:
                self.names += 1
                self.pronouns += name in PRONOUNS


def sizes_of(tree: ast.AST) -> dict[ast.AST, int]:
    """Nodes in the subtree of every node, counted once from the leaves up."""
    sizes: dict[ast.AST, int] = {}
    # `ast.walk` lists a node before what it holds.
    for node in reversed(list(ast.walk(tree))):
        sizes[node] = 1 + sum(sizes[child] for child in ast.iter_child_nodes(node))
    return sizes


def is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def is_heavy(comprehension: ast.AST, size: int) -> bool:
    """Whether it has two loops, two conditions, a comprehension or a conditional expression inside, or many nodes."""
    loops = comprehension.generators
    inside = [node for node in ast.walk(comprehension) if node is not comprehension]
    return (
        len(loops) > 1
        or any(len(loop.ifs) > 1 for loop in loops)
        or any(isinstance(node, (*COMPREHENSION, ast.IfExp)) for node in inside)
        or size > LARGEST_COMPREHENSION
    )


def conditionals_alone(tree: ast.AST) -> set[ast.AST]:
    """Conditional expressions that are the whole right side of an assignment, or all that a function returns."""
    simple = (ast.Assign, ast.AnnAssign, ast.Return, ast.Expr)
    statements = [node for node in ast.walk(tree) if isinstance(node, simple)]
    return {node.value for node in statements if isinstance(node.value, ast.IfExp)}


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0


def bound_name(node: ast.AST) -> str | None:
    """The name that an assignment, a loop or a parameter gives to a value."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        return node.id
    if isinstance(node, ast.arg) and node.arg not in ("self", "cls"):
        return node.arg
    return None


def lines_with_comments(source: str) -> set[int]:
    """Numbers of the lines that hold a comment; directives to the linter and the type checker are none."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token for token in tokens if token.type == tokenize.COMMENT]
    return {token.start[0] for token in comments if not token.string.startswith(("# noqa", "# type:"))}


@cache
def density_of_file(path: Path) -> Density:
    """Density of one file: its package and its room both count it."""
    counts = Density()
    counts.add(path.read_text(encoding="utf-8"))
    return counts


def density(folder: str) -> Density:
    """Density of all files below a folder of the repository."""
    files = [density_of_file(path) for path in sorted((ROOT / folder).rglob("*.py"))]
    return Density(**{field.name: sum(getattr(file, field.name) for file in files) for field in fields(Density)})


def exceeded(total: Density, limits: dict[str, float]) -> list[str]:
    """Counts above their limit."""
    rates = {count: total.per_thousand(count) for count in limits}
    return [f"{count}: {rate:.1f}, at most {limits[count]:g}" for count, rate in rates.items() if rate > limits[count]]


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_are_read_at_first_sight(package):
    total = density(package)
    assert not exceeded(total, PACKAGE_LIMITS)
    assert total.pronouns <= LARGEST_SHARE_OF_PRONOUNS * total.names
    assert total.comment_lines >= SMALLEST_SHARE_OF_COMMENTS * total.lines


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_are_read_at_first_sight(room):
    assert not exceeded(density(room), ROOM_LIMITS)


def test_functions_are_short():
    assert sum(density(package).long_functions for package in PACKAGES) <= MOST_LONG_FUNCTIONS


DENSE = '''
def f(rows, flag):
    """Nothing."""
    # why
    pairs = [(a, b) for a in rows for b in a]
    entry = max(1 if flag else 2, 3)
    alone = 1 if flag else 2
    return {key: [x for x in value] for key, value in pairs}, entry  # noqa: X
'''


def test_what_is_counted():
    total = Density()
    total.add(DENSE)
    assert (total.statements, total.heavy, total.conditional, total.wide, total.long_functions) == (5, 2, 1, 0, 0)
    assert (total.names, total.pronouns, total.comment_lines) == (10, 1, 1)
    long = Density()
    long.add("def f():\n" + "    x = 1\n" * 51 + "y = " + " + ".join(["1"] * 40) + "\n")
    assert (long.long_functions, long.wide) == (1, 1)

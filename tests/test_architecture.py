"""The house holds: arrows point one way, rooms are shallow, files are small, names are explicit, references resolve."""

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hmtb_twin", "sysid", "scenarios")
# Which other packages a package may import.
ARROWS = {"scenarios": {"hmtb_twin", "sysid"}, "hmtb_twin": {"sysid"}, "sysid": set()}
# What the laboratory hands over; it may use nothing else of the analyst's.
RECORDS = {"IOData", "StateSpace", "FrequencyResponse"}
# Rooms of each package from the ground up: a room imports only rooms that stand before it.
ROOMS = {
    "sysid": ("records", "models", "polynomial", "validation", "subspace", "recursive", "frequency", "plots"),
    "hmtb_twin": ("parameters", "hydraulics", "arm", "control", "bus", "run", "truth"),
    "scenarios": (
        *("files", "jobs", "experiments", "report", "truth", "identification", "datasets"),
        *("estimators", "problems", "bench", "thesis", "commands"),
    ),
}
# Modules of a package outside its rooms.
FLAT = {"__init__", "__main__"}
FORBIDDEN_NAMES = {"utils", "util", "base", "common", "misc", "helpers", "helper", "core"}
LONGEST_FILE = 400
REFERENCE_KEY = re.compile(r"[\[;]\s*([A-Z][A-Za-z]+(?:19|20)\d\d[a-z]?)\b")

MODULES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
module = pytest.mark.parametrize("path", MODULES, ids=[p.relative_to(ROOT).as_posix() for p in MODULES])


def imports(path: Path) -> Iterator[tuple[str, str | None, int]]:
    """Yield (module, imported name or None, line) of every import, inside functions too, relative ones resolved."""
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, None, node.lineno
        elif isinstance(node, ast.ImportFrom):
            parts = package[: len(package) - node.level + 1] if node.level else ()
            origin = ".".join((*parts, node.module) if node.module else parts)
            for alias in node.names:
                yield origin, alias.name, node.lineno


@pytest.mark.parametrize("package", PACKAGES)
def test_every_package_is_there(package: str) -> None:
    assert (ROOT / package / "__init__.py").is_file()
    assert (ROOT / package / "py.typed").is_file()


@module
def test_arrows_point_one_way(path: Path) -> None:
    room = path.relative_to(ROOT).parts[0]
    wrong = [
        f"line {line}: {origin}"
        for origin, _, line in imports(path)
        if (target := origin.partition(".")[0]) in PACKAGES and target != room and target not in ARROWS[room]
    ]
    assert not wrong, f"{room} may import only {sorted(ARROWS[room]) or 'neither of the other packages'}: {wrong}"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_stands_in_a_room(package: str) -> None:
    flat = {path.stem for path in (ROOT / package).glob("*.py")} - FLAT
    assert not flat, f"{package} has modules outside its rooms: {sorted(flat)}"
    assert {path.parent.name for path in (ROOT / package).glob("*/*.py")} == set(ROOMS[package])


@module
def test_a_room_imports_only_rooms_before_it(path: Path) -> None:
    package, *room = path.relative_to(ROOT).parts[:-1]
    if not room:
        return
    before = ROOMS[package][: ROOMS[package].index(room[0]) + 1]
    wrong = [
        f"line {line}: {origin}"
        for origin, _, line in imports(path)
        if origin.startswith(f"{package}.") and origin.split(".")[1] not in before
    ]
    assert not wrong, f"{package}.{room[0]} may import {before} of its package: {wrong}"


@module
def test_the_laboratory_takes_only_records_from_the_analyst(path: Path) -> None:
    if path.relative_to(ROOT).parts[0] != "hmtb_twin":
        return
    wrong = [
        f"line {line}: {origin} {name or ''}"
        for origin, name, line in imports(path)
        if origin.partition(".")[0] == "sysid" and name not in RECORDS
    ]
    assert not wrong, f"hmtb_twin may import {sorted(RECORDS)} from sysid, by name: {wrong}"


@module
def test_the_bare_name_sysid_is_ours(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    wrong = re.findall(
        r"^\s*(?:from mujoco import sysid(?! as mj_sysid)|import mujoco\.sysid(?! as mj_sysid)).*", text, re.M
    )
    assert not wrong, f"write 'import mujoco.sysid as mj_sysid': {wrong}"


@module
def test_files_are_small_shallow_named_and_documented(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    parts = path.relative_to(ROOT).parts
    assert len(parts) <= 3, f"packages are at most two deep, {path.relative_to(ROOT)} is deeper"
    assert not FORBIDDEN_NAMES & {part.removesuffix(".py").strip("_") for part in parts}, "name the concept"
    assert text.count("\n") <= LONGEST_FILE, f"{text.count(chr(10))} lines, at most {LONGEST_FILE}"
    assert ast.get_docstring(ast.parse(text)), "a file says in its first line what it holds"


@module
def test_every_cited_reference_is_listed(path: Path) -> None:
    listed = re.findall(r"^- \*\*(\w+)\*\*", (ROOT / "docs/references.md").read_text(encoding="utf-8"), re.M)
    duplicates = {key for key in listed if listed.count(key) > 1}
    assert not duplicates, f"docs/references.md lists {sorted(duplicates)} more than once"
    missing = set(REFERENCE_KEY.findall(path.read_text(encoding="utf-8"))) - set(listed)
    assert not missing, f"docs/references.md lacks {sorted(missing)}, it has {sorted(listed)}"


def packages() -> list[str]:
    """Return the dotted names of all packages, nested ones included."""
    return [
        ".".join(init.relative_to(ROOT).parent.parts)
        for package in PACKAGES
        for init in sorted((ROOT / package).rglob("__init__.py"))
    ]


@pytest.mark.parametrize("name", packages())
def test_public_names_are_explicit_and_importable(name: str) -> None:
    package = importlib.import_module(name)
    public = getattr(package, "__all__", None)
    assert isinstance(public, list | tuple), f"{name} has no explicit __all__"
    assert len(set(public)) == len(public), f"{name}.__all__ names something twice"
    missing = [entry for entry in public if not hasattr(package, entry)]
    assert not missing, f"{name}.__all__ promises {missing}"
    undocumented = [
        entry for entry in public if callable(value := getattr(package, entry)) and not getattr(value, "__doc__", None)
    ]
    assert not undocumented, f"{name} exports {undocumented} without a docstring"


@pytest.mark.parametrize("name", PACKAGES)
def test_all_modules_import_without_the_others_having_been_imported(name: str) -> None:
    """A cycle shows only when its other end is entered first, so each module is imported as the first of its package.

    Whichever it is, the package itself comes before it: what that loads stays, and is the same for all. The other
    packages stay too, because they import nothing from this one or nothing that imports back.
    """
    modules = [".".join(p.relative_to(ROOT).with_suffix("").parts) for p in sorted((ROOT / name).rglob("*.py"))]
    modules = [m.removesuffix(".__init__") for m in modules if not m.endswith("__main__")]
    script = (
        "import importlib, sys\n"
        f"importlib.import_module({name!r})\n"
        "first = set(sys.modules)\n"
        f"for module in {modules!r}:\n"
        f"    for loaded in [m for m in sys.modules if m.startswith({name + '.'!r}) and m not in first]:\n"
        "        parent, _, own = loaded.rpartition('.')\n"
        "        if parent in first and own in vars(sys.modules[parent]):\n"
        "            delattr(sys.modules[parent], own)\n"
        "        del sys.modules[loaded]\n"
        "    importlib.import_module(module)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr

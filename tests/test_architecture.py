"""The house holds: arrows point one way, rooms are shallow, names are explicit, references resolve."""

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hmtb_twin", "sysid", "scenarios")
# Which other packages a package may import.
ARROWS = {"scenarios": {"hmtb_twin", "sysid"}, "hmtb_twin": {"sysid"}, "sysid": set()}
# What the laboratory hands over, and the process that reads files from elsewhere; it may use nothing else of the
# analyst's.
RECORDS = {"IOData", "StateSpace", "FrequencyResponse"}
READING = {"read_apart", "hdf5_listing", "hdf5_contents", "UnreadableError"}
# Rooms of each package from the ground up: a room imports only rooms that stand before it.
ROOMS = {
    "sysid": (
        *("records", "models", "polynomial", "validation", "subspace", "recursive", "frequency"),
        *("continuous", "exchange", "design", "selection", "control", "plots"),
    ),
    "hmtb_twin": ("files", "parameters", "arm_files", "hydraulics", "arm", "control", "bus", "run", "truth"),
    "scenarios": (
        *("files", "jobs", "experiments", "report", "truth", "identification", "model_report", "record_figures"),
        *("control", "datasets", "exchange"),
        *("estimators", "problems", "bench", "thesis", "station", "commands"),
    ),
}
# Modules of a package outside its rooms.
FLAT = {"__init__", "__main__"}
FORBIDDEN_NAMES = {"utils", "util", "base", "common", "misc", "helpers", "helper", "core"}
# Of `scenarios`: files of a room, `__init__` included, and its public names. The chapters of the thesis are many.
MOST_FILES, EXEMPT = 25, {"thesis"}
PUBLIC_NAMES = range(3, 9)
MOST_ARROWS, MOST_FLOORS = 80, 12
REFERENCE_KEY = re.compile(r"[\[;]\s*([A-Z][A-Za-z]+(?:19|20)\d\d[a-z]?)\b")


def imported_by_text(call: ast.Call) -> list[str]:
    """Modules of ours that `import_module` or `__import__` loads; for a name in braces stands *."""
    function = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if function not in ("import_module", "__import__") or not call.args:
        return []
    beginning = call.args[0]
    if isinstance(beginning, ast.JoinedStr):
        beginning = beginning.values[0]
    name = beginning.value if isinstance(beginning, ast.Constant) else None
    if not isinstance(name, str) or name.partition(".")[0] not in PACKAGES:
        return []
    return [f"{name}*" if name.endswith(".") else name]


@dataclass(eq=False)
class Module:
    """A file of the product."""

    path: Path

    @property
    def name(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @property
    def dotted(self) -> str:
        return self.name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    @property
    def package(self) -> str:
        return self.path.relative_to(ROOT).parts[0]

    @property
    def room(self) -> str | None:
        parts = self.path.relative_to(ROOT).parts
        return parts[1] if len(parts) > 2 else None

    @cached_property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def imports(self) -> list[tuple[str, str | None, int]]:
        """(module, imported name or None, line) of every import: inside functions, relative ones, by a text too."""
        package, lines = self.path.relative_to(ROOT).parent.parts, []
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                lines += [(alias.name, None, node.lineno) for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                parts = package[: len(package) - node.level + 1] if node.level else ()
                origin = ".".join((*parts, node.module) if node.module else parts)
                lines += [(origin, alias.name, node.lineno) for alias in node.names]
            elif isinstance(node, ast.Call) and self.room is not None:
                lines += [(origin, None, node.lineno) for origin in imported_by_text(node)]
        return lines


MODULES = [Module(path) for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def wrong_imports(is_wrong: Callable[[Module, str, str | None], bool]) -> list[str]:
    """Imports that break a rule, each with its file and line."""
    return [
        f"{module.name}:{line}: {origin} {name or ''}"
        for module in MODULES
        for origin, name, line in module.imports
        if is_wrong(module, origin, name)
    ]


def test_sysid_loads_scipy_and_what_draws_on_first_use():
    # half the processor time of `import sysid` otherwise
    code = "import sys, sysid; print(*(name for name in sys.modules if name.count('.') <= 1))"
    loaded = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    heavy = {"scipy.signal", "scipy.stats", "scipy.optimize", "scipy.fft", "matplotlib", "control", "xarray", "pandas"}
    assert not heavy & set(loaded.stdout.split())


@pytest.mark.slow
def test_packages_import_one_way():
    def is_wrong(module: Module, origin: str, name: str | None) -> bool:
        target = origin.partition(".")[0]
        return target in PACKAGES and target != module.package and target not in ARROWS[module.package]

    assert not wrong_imports(is_wrong), f"each package may import only {ARROWS}"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_stands_in_a_room(package):
    assert (ROOT / package / "py.typed").is_file()
    flat = {path.stem for path in (ROOT / package).glob("*.py")} - FLAT
    assert not flat, f"{package} has modules outside its rooms: {sorted(flat)}"
    assert {path.parent.name for path in (ROOT / package).glob("*/*.py")} == set(ROOMS[package])


def test_a_room_imports_only_rooms_before_it():
    def is_wrong(module: Module, origin: str, name: str | None) -> bool:
        package, _, rest = origin.partition(".")
        if module.room is None or package != module.package or not rest:
            return False
        rooms = ROOMS[package]
        return rest.partition(".")[0] not in rooms[: rooms.index(module.room) + 1]

    assert not wrong_imports(is_wrong), f"rooms from the ground up: {ROOMS}"


def test_rooms_of_the_study_are_small():
    for room in ROOMS["scenarios"]:
        files = sorted((ROOT / "scenarios" / room).glob("*.py"))
        assert len(files) <= MOST_FILES or room in EXEMPT, f"{room} has {len(files)} files, at most {MOST_FILES}"
        public = importlib.import_module(f"scenarios.{room}").__all__
        assert len(public) in PUBLIC_NAMES, f"{room} has {len(public)} public names, expected {PUBLIC_NAMES}"


def test_rooms_of_the_study_hang_together_loosely():
    rooms = ROOMS["scenarios"]
    arrows = {
        (module.room, target)
        for module in MODULES
        for origin, _, _ in module.imports
        if module.room
        and origin.startswith("scenarios.")
        and (target := origin.split(".")[1]) in rooms
        and target != module.room
    }
    assert len(arrows) <= MOST_ARROWS
    floors: dict[str, int] = {}
    for room in rooms:
        floors[room] = 1 + max((floors[target] for source, target in arrows if source == room), default=0)
    assert max(floors.values()) <= MOST_FLOORS, floors


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('importlib.import_module("sysid.plots.thumbnail")', ["sysid.plots.thumbnail"]),
        ('import_module(f"scenarios.commands.{name}")', ["scenarios.commands.*"]),
        ('__import__("hmtb_twin.run")', ["hmtb_twin.run"]),
        ('import_module(f"scipy.{name}"), import_module(name)', []),
        ('print("sysid.plots")', []),
    ],
)
def test_imports_by_a_text_are_found(line, expected):
    calls = [node for node in ast.walk(ast.parse(line)) if isinstance(node, ast.Call)]
    assert [name for call in calls for name in imported_by_text(call)] == expected


def test_no_module_imports_itself_through_others():
    names = {module.dotted: module for module in MODULES}

    def targets(module: Module) -> set[str]:
        return {
            full if (full := f"{origin}.{name}") in names else origin
            for origin, name, _ in module.imports
            if f"{origin}.{name}" in names or origin in names
        }

    arrows = {name: targets(module) - {name} for name, module in names.items()}
    while leaves := {name for name, others in arrows.items() if not others & arrows.keys()}:
        for leaf in leaves:
            del arrows[leaf]
    assert not arrows, f"modules in circles, or that lead into one: {sorted(arrows)}"


def test_the_laboratory_takes_only_records_from_the_analyst():
    def is_wrong(module: Module, origin: str, name: str | None) -> bool:
        return module.package == "hmtb_twin" and origin.partition(".")[0] == "sysid" and name not in RECORDS | READING

    assert not wrong_imports(is_wrong), f"hmtb_twin may import {sorted(RECORDS | READING)} from sysid, by name"


def test_the_bare_name_sysid_is_ours():
    pattern = r"^\s*(?:from mujoco import sysid(?! as mj_sysid)|import mujoco\.sysid(?! as mj_sysid)).*"
    wrong = {module.name: lines for module in MODULES if (lines := re.findall(pattern, module.text, re.M))}
    assert not wrong, f"write 'import mujoco.sysid as mj_sysid': {wrong}"


def test_files_are_shallow_named_and_documented():
    for module in MODULES:
        parts = module.path.relative_to(ROOT).parts
        assert len(parts) <= 3, f"packages are at most two deep, {module.name} is deeper"
        assert not FORBIDDEN_NAMES & {part.removesuffix(".py").strip("_") for part in parts}, module.name
        assert ast.get_docstring(module.tree), f"{module.name} does not say in its first line what it holds"


def test_every_cited_reference_is_listed():
    listed = re.findall(r"^- \*\*(\w+)\*\*", (ROOT / "docs/references.md").read_text(encoding="utf-8"), re.M)
    duplicates = {key for key in listed if listed.count(key) > 1}
    assert not duplicates, f"docs/references.md lists {sorted(duplicates)} more than once"
    missing = {m.name: keys for m in MODULES if (keys := set(REFERENCE_KEY.findall(m.text)) - set(listed))}
    assert not missing, f"docs/references.md lacks {missing}, it has {sorted(listed)}"


def test_the_page_of_architecture_lists_every_room():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)` \| (.*) \|$", page, re.M)
    rooms = [(package, room) for package in ("sysid", "hmtb_twin", "scenarios") for room in ROOMS[package]]
    docs = [importlib.import_module(f"{package}.{room}").__doc__ or "" for package, room in rooms]
    first = [" ".join(doc.partition("\n\n")[0].split()) for doc in docs]
    assert listed == [(room, line) for (_, room), line in zip(rooms, first, strict=True)]


@pytest.mark.parametrize("name", ["docs/architecture.md", "CONTRIBUTING.md"])
def test_pages_on_the_code_name_only_paths_that_exist(name):
    page = (ROOT / name).read_text(encoding="utf-8")
    named = re.findall(r"`((?:sysid|hmtb_twin|scenarios|models|tests)/[\w/.]+)`", page)
    missing = [path for path in named if "NAME" not in path and not list(ROOT.glob(f"{path}*"))]
    assert not missing, f"{name} names {missing}"


@pytest.mark.parametrize("name", [module.dotted for module in MODULES if module.path.stem == "__init__"])
def test_public_names_are_explicit_and_importable(name):
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


@pytest.mark.slow
def test_every_module_can_be_imported():
    """In a process of its own, so that nothing which other tests have loaded helps."""
    names = [module.dotted for module in MODULES if module.path.stem != "__main__"]
    script = f"import importlib\nfor name in {names!r}:\n    importlib.import_module(name)"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_foreign_files_pass_their_one_guard():
    reading, writing = "sysid/records/foreign_files.py", "hmtb_twin/files/netcdf_writer.py"
    guards = {
        "tomllib": {"hmtb_twin/files/toml_text.py"},
        "scipy.io.loadmat": {reading},
        "scipy.io.whosmat": {reading},
        "h5py": {reading, writing},
    }

    def is_wrong(module: Module, origin: str, name: str | None) -> bool:
        return any(
            reader in (origin, f"{origin}.{name}") and module.name not in places for reader, places in guards.items()
        )

    assert not wrong_imports(is_wrong), f"such files are read through {guards}"

"""The wheel, installed alone in an empty environment, carries everything that is needed at run time."""

import json
import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command without the checkout on any search path and return what it printed."""
    environment = {key: value for key, value in os.environ.items() if key not in {"PYTHONPATH", "PYTHONHOME"}}
    words = [str(part) for part in command]
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Return a wheel built from the checkout, with the build tools that are installed already."""
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    (built,) = folder.glob("hmtb_twin-*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory):
    """Return the folder of executables of an environment that holds the wheel and nothing else of this project.

    The dependencies are those installed here already: a .pth line appends their folder to the search path, so nothing
    is downloaded again. Appended folders come after the environment's own, and .pth files inside them are not read, so
    an editable install of the checkout stays invisible. Pinocchio's wheels put their packages under cmeel.prefix and
    reach them by such a .pth file, hence the second line.
    """
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder)
    executables = folder / ("Scripts" if os.name == "nt" else "bin")
    python = executables / "python"
    run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=folder)
    installed = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip())
    dependencies = Path(sysconfig.get_path("purelib"))
    lines = [str(dependencies), *map(str, dependencies.glob("cmeel.prefix/lib/python*/site-packages"))]
    (installed / "dependencies.pth").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return executables


@pytest.mark.slow
def test_the_wheel_holds_models_data_and_types_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    expected = set()
    for folder, prefix in (("models", "hmtb_twin/"), ("hmtb_twin", ""), ("sysid", ""), ("scenarios", "")):
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file() and "__pycache__" not in path.parts]
        expected |= {prefix + path.relative_to(ROOT).as_posix() for path in files}
    # It builds `sysid` alone.
    expected.remove("sysid/pyproject.toml")
    assert held == expected


@pytest.mark.slow
def test_the_command_lists_the_scenarios(environment, tmp_path):
    printed = run(environment / "hmtb", "scenarios", "list", "--json", cwd=tmp_path)
    assert "siso-1-shoulder_yaw" in json.dumps(json.loads(printed))


@pytest.mark.thorough
def test_the_packages_of_the_wheel_find_their_data_and_move_the_arm(environment, tmp_path):
    study = ROOT / "scenarios"
    names = [
        path.relative_to(study).as_posix()
        for path in study.rglob("*")
        if "__pycache__" not in path.parts and path.is_file() and path.suffix not in {".py", ".pyc"}
    ]
    assert any(name.endswith((".j2", ".html")) for name in names), "the report needs a template"
    script = (
        "from dataclasses import replace\n"
        "from importlib.resources import files\n"
        "import hmtb_twin, sysid, scenarios\n"
        "scenario = replace(scenarios.load('siso-1-shoulder_yaw'), duration=0.2)\n"
        "hmtb_twin.simulate([scenario])\n"
        f"[(files('scenarios') / name).read_bytes() for name in {names!r}]\n"
        "print(hmtb_twin.__file__, sysid.__file__, scenarios.__file__, sep='\\n')\n"
    )
    origins = run(environment / "python", "-c", script, cwd=tmp_path).split()
    assert len(origins) == 3
    assert all(Path(origin).is_relative_to(environment.parent) for origin in origins), origins
    assert not list(tmp_path.iterdir()), "nothing is written where a user happens to stand"

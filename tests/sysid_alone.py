"""Install `sysid` alone into a new environment, and run its tests there, without MuJoCo and without this checkout.

    python tests/sysid_alone.py

It prints how long `pip install ./sysid` took and how large the environment is. Exact recovery is tested with NumPy and
SciPy alone, then everything with the extras. The exit code is that of the tests.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).parents[1]
LARGEST = 300
"""Megabytes of an environment with pip, NumPy, SciPy and `sysid`."""

NEEDED = ("__init__.py", "conftest.py", "mat_bytes.py", "refusals.py", "signals.py")
"""Files in `tests` that the tests of `sysid` use."""

BENCHMARKS = ("choose_orders", "delays", "misleading_records", "nonlinear_joints", "short_records", "tables")
"""Modules in `tests/benchmarks` whose records they share."""


def megabytes(folder: Path) -> float:
    """Size of the files in a folder."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def install(python: Path, *packages: str) -> None:
    """Install packages by pip, with the versions that the project was tested with."""
    command = (python, "-m", "pip", "install", "--quiet", "--constraint", ROOT / "constraints.txt", *packages)
    subprocess.run(command, check=True, cwd=ROOT)


def copy_tests(folder: Path) -> None:
    """Copy the tests of `sysid` and the settings of pytest, so that nothing else of the checkout can be imported."""
    shutil.copytree(ROOT / "tests" / "sysid", folder / "tests" / "sysid", ignore=shutil.ignore_patterns("__pycache__"))
    for name in NEEDED:
        shutil.copy(ROOT / "tests" / name, folder / "tests" / name)
    (folder / "tests" / "benchmarks").mkdir()
    for name in BENCHMARKS:
        shutil.copy(ROOT / "tests" / "benchmarks" / f"{name}.py", folder / "tests" / "benchmarks")
    settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    _, _, settings = settings.partition("[tool.pytest.ini_options]")
    settings, _, _ = settings.partition("\n[")
    # A test compares the keys of a model file with its page.
    (folder / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "model-file.md", folder / "docs")
    (folder / "pyproject.toml").write_text("[tool.pytest.ini_options]" + settings, encoding="utf-8")


def main() -> int:
    """Install, measure, test."""
    # A path that the caller adds would bring this checkout back.
    os.environ.pop("PYTHONPATH", None)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = perf_counter()
        venv.create(folder / "environment", with_pip=True)
        python = folder / "environment" / "bin" / "python"
        install(python, "./sysid")
        size = megabytes(folder / "environment")
        print(f"sysid alone: installed in {perf_counter() - begin:.0f} s, {size:.0f} MB", flush=True)
        if size > LARGEST:
            print(f"sysid alone: expected at most {LARGEST} MB", file=sys.stderr)
            return 1
        install(python, "pytest", "hypothesis")
        copy_tests(folder)
        for package in ("mujoco", "hmtb_twin", "scenarios", "pandas"):
            found = subprocess.run((python, "-c", f"import {package}"), cwd=folder, stderr=subprocess.DEVNULL)
            assert found.returncode != 0, f"{package} can be imported in the environment of sysid alone"
        pytest = (python, "-m", "pytest", "-q")
        bare = subprocess.run((*pytest, "tests/sysid/test_exact_recovery.py"), cwd=folder).returncode
        # numba integrates the joints with friction that some of the tests identify
        install(python, "./sysid[control,files,logs,plots,test]", "numba")
        # the thorough tests take hours, and run beside the others where everything is installed
        complete = subprocess.run((*pytest, "-m", "not thorough", "tests/sysid"), cwd=folder).returncode
        return bare or complete


if __name__ == "__main__":
    sys.exit(main())

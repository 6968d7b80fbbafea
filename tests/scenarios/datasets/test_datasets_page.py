"""The pages on data sets and their pictures: the snippets run in Python and Octave, with equal numbers."""

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image

from hmtb_twin.parameters.specimen_draw import TwinDistributions
from scenarios.datasets.baselines import BaselineData, baseline
from scenarios.datasets.record_block import RecordBlock
from scenarios.datasets.score import score
from scenarios.datasets.spec import METRICS, UNITS, BaselineSpec, DataSetSpec, Method, Scoring, TruthSpec, shipped
from scenarios.exchange.exporter import FORMATS, export
from scenarios.experiments.multisines import Multisines
from tests.benchmarks.tables import ROOT, environment

PAGE, SPEC_PAGE, COURSE_PAGE = (
    (ROOT / f"docs/{name}.md").read_text(encoding="utf-8") for name in ("datasets", "dataset-spec", "dataset-course")
)
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")

TINY = {
    "multisine-elbow_pitch-01": "noise",
    "prbs-elbow_pitch": "binary-elbow_pitch",
    "hmtb-siso-v1": "tiny-v1",
    "class/class-ada-v1": "tiny-v1",
}
"""What the tiny data set has in the place of what the pages speak of."""


@pytest.fixture(scope="module")
def place(tiny, tmp_path_factory):
    """A folder as a reader of the page has it: the data set, and its records as .mat and CSV."""
    folder = tmp_path_factory.mktemp("reader")
    (folder / tiny.name).symlink_to(tiny, target_is_directory=True)
    export(tiny, folder, ("mat", "csv"))
    return folder


def snippets(language, page=PAGE):
    for name, tiny in TINY.items():
        page = page.replace(name, tiny)
    return re.findall(rf"^```{language}\n(.*?)^```", page, re.M | re.S)


def digest(values):
    """SHA-256 of the bytes of an array in Octave's order."""
    return sha256(np.asfortranarray(values).tobytes(order="F")).hexdigest()


@pytest.mark.slow
def test_the_python_snippets_run(place, data_set):
    # tests/test_code_blocks.py runs those of other packages
    text = "\n".join(one for one in snippets("python") if "identibench" not in one)
    command = [sys.executable, "-c", text]
    done = subprocess.run(command, cwd=place, env=environment(), capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "0.02 binary-elbow_pitch (200,)" in done.stdout
    of_models, of_files = done.stdout.splitlines()[-2:]
    limits = BaselineData(data_set, data_set.spec.baselines)
    hold, oe = (baseline(limits, Method.parsed(name)).test.mean for name in ("hold", "oe:2/2"))
    assert 0.2 * oe < float(re.findall(r"[\d.]+", of_models)[0]) < hold
    assert 0.2 * oe < float(of_files) < hold


def test_the_snippet_for_students_comes_near_the_baseline(place, data_set, monkeypatch):
    """Command and answer are taken from their means: the first command is a step of the excitation already."""
    (snippet,) = snippets("python", COURSE_PAGE)
    monkeypatch.chdir(place)

    def reached(text):
        shutil.rmtree("submissions", ignore_errors=True)
        names = {}
        exec(text, names)
        return score({names["test"].name: names["yhat"]}, data_set).mean

    best = baseline(BaselineData(data_set, data_set.spec.baselines), Method.parsed("oe:2/2/2")).test.mean
    assert reached(snippet) < 1.05 * best
    assert reached(snippet) < 0.8 * reached(snippet.replace(".mean(axis=0)", "[0]"))


def test_the_hash_comes_out_by_the_recipe_of_the_page(tiny):
    """Computed by what the page says alone: HDF5, JSON and SHA-256."""
    index = json.loads((tiny / "experiments.json").read_text(encoding="utf-8"))
    whole = sha256()
    for experiment in index["experiments"]:
        for place in sorted(experiment["arrays"]):
            with h5py.File(tiny / place) as file:
                for name in sorted(experiment["arrays"][place]):
                    values = file[name][()]
                    word = {"float64": "<f8", "int64": "<i8"}[values.dtype.name]
                    line = f"{word} {values.shape}\n".encode("ascii")
                    own = sha256(line + values.astype(word).tobytes(order="C")).hexdigest()
                    assert own == experiment["arrays"][place][name]
                    whole.update(f"{own}  {place}:{name}\n".encode())
    assert whole.hexdigest() == index["hash"]


@pytest.mark.skipif(OCTAVE is None, reason="Octave is not installed: apt-get install octave")
def test_octave_reads_the_same_numbers(place, data_set):
    mat, csv, _ = snippets("matlab")
    both = """
    printf('%s %s %s ', num2hex(u(1)), num2hex(u(end)), num2hex(sum(y)));
    printf('%s %s\\n', hash('sha256', char(typecast(u', 'uint8'))), hash('sha256', char(typecast(y', 'uint8'))));
    """
    rest = """
    printf('%s %d %s %s\\n', num2hex(dt), window, class(train.sample), num2hex(t(end)));
    printf('%s %s %s\\n', train.output_names{1}, train.units.y, test.about.part);
    printf('%s\\n', hash('sha256', char(typecast(test.force(:)', 'uint8'))));
    printf('%s\\n', hash('sha256', char(typecast(table(:)', 'uint8'))));
    """
    of_mat, of_csv, *others = run_octave(mat + both + csv + both + rest, place)
    record, test = (data_set.record(name) for name in ("binary-elbow_pitch", "noise"))
    first, last, total, u_hash, y_hash = of_mat.split()
    assert of_csv == of_mat
    assert [bits(first), bits(last)] == [record.u[0], record.u[-1]]
    assert bits(total) == pytest.approx(record.y.sum(), rel=1e-12)  # sums depend on their order
    assert (u_hash, y_hash) == (digest(record.u), digest(record.y))
    dt, window, kind, end = others[0].split()
    assert (bits(dt), window, kind, bits(end)) == (0.02, "20", "int64", 199 / 50)
    assert others[1].split() == ["elbow_pitch", "rad", "test"]
    with h5py.File(place / "tiny-v1" / "data/test/noise.nc") as file:
        assert others[2] == digest(file["force"][:])
    table = np.loadtxt(place / "tiny-v1-csv/train/binary-elbow_pitch.csv", delimiter=",", skiprows=1)
    assert others[3] == digest(table) and np.array_equal(table[:, 2], record.u)
    assert test.state_initialization_window_length == int(window)


def run_octave(text, place):
    """Lines that Octave prints."""
    command = [str(OCTAVE), "--no-gui", "--no-init-file", "--quiet", "--eval", text]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def bits(text):
    """The number that Octave's `num2hex` writes."""
    return float(np.frombuffer(bytes.fromhex(text), ">f8")[0])


@pytest.mark.skipif(
    OCTAVE is None or not list(Path("/usr/share/octave/packages").glob("netcdf*")),
    reason="Octave's netcdf package is not installed: apt-get install octave-netcdf",
)
def test_octave_reads_the_files_themselves(place, data_set):
    hashes = "hash('sha256', char(typecast(u(:)', 'uint8'))), hash('sha256', char(typecast(y', 'uint8')))"
    lines = run_octave(f"pkg load netcdf\n{snippets('matlab')[2]}printf('%s\\n', {hashes});", place)
    record = data_set.record("binary-elbow_pitch")
    assert lines == [digest(record.u), digest(record.y)]


def rows(page, section):
    """The tables of a section of a page: second columns by the names in the first."""
    lines = page.split(f"\n## {section}\n")[1].split("\n## ")[0].splitlines()
    cells = [line.split(" | ", 1) for line in lines if line.startswith("| `")]
    return {name: text for names, text in cells for name in re.findall(r"`([^`]+)`", names)}


def test_every_key_of_a_spec_and_every_format_stands_on_its_page_and_no_other():
    texts = rows(SPEC_PAGE, "The spec file")
    tables = {"[scoring]", "[truth]", "[baselines]", "[twins]", "[[records]]"}
    kinds = (DataSetSpec, RecordBlock, TwinDistributions)
    known = {entry.name for kind in kinds for entry in fields(kind)} - {name.strip("[]") for name in tables}
    assert set(texts) == known | tables
    inside = {"[scoring]": Scoring, "[truth]": TruthSpec, "[baselines]": BaselineSpec, "multisines": Multisines}
    for key, kind in inside.items():
        missing = {entry.name for entry in fields(kind)} - set(re.findall(r"`(\w+)`", texts[key]))
        assert not missing, f"{key}: {missing}"
    assert set(re.findall(r"`(\w+)`", texts["[scoring]"])) >= {*METRICS, *UNITS}
    assert list(rows(PAGE, "How models are scored")) == list(METRICS)
    formats = PAGE.split("### Formats")[1].split("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", formats, re.M) == list(FORMATS)


def test_every_data_set_stands_on_the_page_with_its_picture():
    table = PAGE.split("\n## ")[0]
    assert set(re.findall(r"^\| `([\w-]+)` \|", table, re.M)) == set(shipped())
    pictures = re.findall(r"\]\((images/datasets/[^)]+)\)", PAGE)
    assert {Path(picture).stem for picture in pictures} == set(shipped())
    for picture in pictures:
        assert 10_000 < (ROOT / "docs" / picture).stat().st_size < 150_000


def test_the_page_names_what_is_in_a_folder(tiny):
    table = SPEC_PAGE.split("\n## The folder\n")[1].split("### Records")[0]
    named = {name.split("/")[0] for row in table.splitlines() for name in re.findall(r"`([^`]+)`", row.split(" | ")[0])}
    there = {path.name for path in tiny.iterdir()}
    assert there <= named, f"docs/dataset-spec.md lacks {sorted(there - named)}"
    assert named - there <= {"baselines.csv", "baselines"}


@pytest.fixture(scope="module")
def pictures():
    """The script that draws the pictures of the page."""
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "docs/images/datasets.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_picture_is_of_the_spec_that_comes_with_the_package(pictures):
    """Where this fails: run docs/images/datasets.py, and look at what it drew."""
    for label, spec in shipped().items():
        with Image.open(pictures.FOLDER / f"{label}.png") as picture:
            assert picture.info[pictures.NOTE] == pictures.drawn_from(spec), f"the picture of {label} is out of date"
    siso = shipped()["hmtb-siso-v1"]
    renamed = replace(siso, title="Other", description="words", truth=replace(siso.truth, floors=3))
    assert pictures.drawn_from(renamed) == pictures.drawn_from(siso)
    block = replace(siso.records[0], duration=30.0)
    assert pictures.drawn_from(replace(siso, records=(block, *siso.records[1:]))) != pictures.drawn_from(siso)


def test_pictures_show_the_numbers_of_the_records(data_set, pictures, monkeypatch):
    *records, spectra, sizes = pictures.gallery_figure(data_set).axes
    record, test = data_set.record("binary-elbow_pitch"), data_set.test[0]
    command, answer = (np.asarray(line.get_ydata()) for line in records[1].lines)
    assert np.allclose(command, np.rad2deg(record.u - record.u[0])) and len(command) == 200
    assert np.allclose(answer, np.rad2deg(record.y - record.u[0]))
    frequency, root = (np.asarray(values) for values in spectra.lines[1].get_data())
    power = np.sum((root / 1000) ** 2) * (frequency[1] - frequency[0])
    assert power == pytest.approx(np.var(test.u), rel=0.5)  # within what the window of a spectrum does
    assert sizes.lines[1].get_ydata() == pytest.approx([np.std(test.y) / np.std(test.u)])
    monkeypatch.setattr(pictures, "FLEET", 1)
    assert pictures.gallery_figure(data_set).axes[-1].get_xlabel() == "true bandwidth of 1 randomised arm / Hz"

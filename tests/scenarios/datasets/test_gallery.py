"""The picture of a data set shows its own numbers."""

import importlib.util
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenarios.datasets import gallery, open_data_set
from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.gallery import gallery_figure
from scenarios.datasets.spec import shipped
from scenarios.files.errors import ScenarioError

ROOT = Path(__file__).parents[3]


def test_every_picture_is_of_the_spec_that_comes_with_the_package() -> None:
    """Where this fails: `make images`, or docs/images/datasets.py alone, and look at what it drew."""
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "docs/images/datasets.py")
    assert spec is not None and spec.loader is not None
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    known = shipped()
    for label, one in known.items():
        with Image.open(pictures.FOLDER / f"{label}.png") as picture:
            assert picture.info[pictures.NOTE] == pictures.drawn_from(one), f"the picture of {label} is out of date"
    siso = known["hmtb-siso-v1"]
    told = replace(siso, title="Other", description="words", truth=replace(siso.truth, floors=3))
    assert pictures.drawn_from(told) == pictures.drawn_from(siso)
    block = replace(siso.records[0], duration=30.0)
    assert pictures.drawn_from(replace(siso, records=(block, *siso.records[1:]))) != pictures.drawn_from(siso)


def test_records_spectra_and_sizes_are_drawn(tiny: Path) -> None:
    data_set = open_data_set(tiny)
    figure = gallery_figure(data_set)
    assert figure._suptitle is not None and figure._suptitle.get_text() == "tiny-v1: 3 records, 0 min"
    *records, spectra, sizes = figure.axes
    assert [axes.get_title(loc="left") for axes in records] == ["binary-shoulder_yaw", "binary-elbow_pitch"]
    record = data_set.record("binary-elbow_pitch")
    command, answer = (np.asarray(line.get_ydata()) for line in records[1].lines)
    assert np.allclose(command, np.rad2deg(record.u - record.u[0])) and len(command) == 200
    assert np.allclose(answer, np.rad2deg(record.y - record.u[0]))
    assert [text.get_text() for text in spectra.get_legend().get_texts()] == ["train", "test"]
    test = sizes.lines[1]
    assert test.get_xdata() == pytest.approx([1000 * np.std(data_set.test[0].u)])
    assert test.get_ydata() == pytest.approx([np.std(data_set.test[0].y) / np.std(data_set.test[0].u)])


def test_the_spectrum_has_the_power_of_the_input(tiny: Path) -> None:
    data_set = open_data_set(tiny)
    *_, spectra, _ = gallery_figure(data_set).axes
    frequency, root = (np.asarray(values) for values in spectra.lines[1].get_data())
    power = np.sum((root / 1000) ** 2) * (frequency[1] - frequency[0])
    assert power == pytest.approx(np.var(data_set.test[0].u), rel=0.5)  # within what the window of a spectrum does


def test_many_arms_show_their_true_bandwidths(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gallery, "FLEET", 1)
    lower = gallery_figure(open_data_set(tiny)).axes[-1]
    assert lower.get_xlabel() == "true bandwidth of 1 randomised arm / Hz"
    truth = read_arm(tiny / "truth/arms/arm-0.nc").joints["shoulder_yaw"].bandwidth_hz
    assert np.asarray(lower.lines[0].get_xdata())[0] == pytest.approx(truth)


def test_a_set_without_truth_is_drawn_and_one_without_training_records_refused(tiny: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(tiny, tmp_path / "set", ignore=shutil.ignore_patterns("truth"))
    assert len(gallery_figure(open_data_set(folder)).axes) == 4
    index = json.loads((folder / "experiments.json").read_text())
    index["experiments"] = [entry for entry in index["experiments"] if entry["part"] == "test"]
    (folder / "experiments.json").write_text(json.dumps(index))
    with pytest.raises(ScenarioError, match="no training record to draw"):
        gallery_figure(open_data_set(folder))

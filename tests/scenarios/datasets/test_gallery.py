"""The pictures of data sets in the docs: each is of the spec that comes with the package, and shows its own numbers."""

import importlib.util
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from scenarios.datasets import open_data_set
from scenarios.datasets.spec import shipped

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def pictures() -> ModuleType:
    """The script that draws them."""
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "docs/images/datasets.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_picture_is_of_the_spec_that_comes_with_the_package(pictures: ModuleType) -> None:
    """Where this fails: run docs/images/datasets.py, and look at what it drew."""
    for label, spec in shipped().items():
        with Image.open(pictures.FOLDER / f"{label}.png") as picture:
            assert picture.info[pictures.NOTE] == pictures.drawn_from(spec), f"the picture of {label} is out of date"
    siso = shipped()["hmtb-siso-v1"]
    renamed = replace(siso, title="Other", description="words", truth=replace(siso.truth, floors=3))
    assert pictures.drawn_from(renamed) == pictures.drawn_from(siso)
    block = replace(siso.records[0], duration=30.0)
    assert pictures.drawn_from(replace(siso, records=(block, *siso.records[1:]))) != pictures.drawn_from(siso)


def test_records_spectra_and_sizes_are_drawn(tiny: Path, pictures: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    data_set = open_data_set(tiny)
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

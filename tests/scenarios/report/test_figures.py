"""Figures are numbered, named once, and kept as files on request."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from scenarios.files.errors import ScenarioError
from scenarios.report.figures import Gallery, photograph, save_figure, svg


def _figure():
    figure = Figure(figsize=(4.0, 2.0), layout="constrained")
    figure.subplots().plot([0.0, 1.0], [0.0, 2.0])
    return figure


def test_figures_are_numbered_as_they_come():
    drawn = []
    gallery = Gallery(drawn=drawn.append)
    first = gallery.add(_figure(), "gain of the joint.", name="gain")
    second = gallery.add(_figure(), "Phase.", name="phase-2")
    assert (first.number, second.number) == (1, 2)
    assert drawn == [1, 2]
    assert first.caption == "Gain of the joint."
    assert 'aria-label="Gain of the joint."' in first.svg
    assert first.shape == pytest.approx(2.0)


@pytest.mark.parametrize("name", ["Gain", "gain curve", "", "gain"])
def test_a_name_is_refused_that_is_no_file_or_taken(name):
    gallery = Gallery()
    gallery.add(_figure(), "Gain.", name="gain")
    with pytest.raises(ScenarioError, match="each name once"):
        gallery.add(_figure(), "Gain.", name=name)


def test_figures_are_kept_as_files_on_request(tmp_path):
    figure = _figure()
    figure.suptitle(r"u$\q$")  # the name of a column, no formula
    save_figure(figure, tmp_path / "gain.png")
    Gallery(tmp_path).add(_figure(), "Gain.", name="gain")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gain.png", "gain.svg"]
    assert (tmp_path / "gain.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (tmp_path / "gain.svg").read_text(encoding="utf-8")
    with pytest.raises(ScenarioError, match="expected one that exists"):
        Gallery(tmp_path / "missing")


def test_svg_escapes_its_description_and_keeps_its_own_marks():
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])
    text = svg(figure, 'a < b & "c"', "m")
    assert 'aria-label="a &lt; b &amp; &quot;c&quot;"' in text
    assert all(mark.startswith("m-") for mark in re.findall(r'\bid="([^"]+)"', text))
    assert "<metadata>" not in text
    assert svg(figure, "same", "m") == svg(figure, "same", "m")


def test_pictures_are_embedded():
    picture = np.zeros((4, 5, 3), dtype=np.uint8)
    assert photograph(picture).startswith("data:image/jpeg;base64,/9j/")

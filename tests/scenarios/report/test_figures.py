"""Figures have a caption and a shape on a page, and are written as files."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from scenarios.report.figures import photograph, picture, save_figure, svg


def _figure():
    figure = Figure(figsize=(4.0, 2.0), layout="constrained")
    figure.subplots().plot([0.0, 1.0], [0.0, 2.0])
    return figure


def test_a_picture_has_its_description_and_shape():
    made = picture(_figure(), "gain of the joint.", "gain", "f1")
    assert (made.name, made.caption) == ("gain", "Gain of the joint.")
    assert 'aria-label="Gain of the joint."' in made.svg
    assert made.shape == pytest.approx(2.0)


def test_figures_are_kept_as_files(tmp_path):
    figure = _figure()
    figure.suptitle(r"u$\q$")  # the name of a column, no formula
    for name in ("gain.png", "gain.svg"):
        save_figure(figure, tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gain.png", "gain.svg"]
    assert (tmp_path / "gain.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (tmp_path / "gain.svg").read_text(encoding="utf-8")


def test_svg_escapes_its_description_and_keeps_its_own_marks():
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])
    text = svg(figure, 'a < b & "c"', "m")
    assert 'aria-label="a &lt; b &amp; &quot;c&quot;"' in text
    assert all(mark.startswith("m-") for mark in re.findall(r'\bid="([^"]+)"', text))
    assert "<metadata>" not in text
    assert svg(figure, "same", "m") == svg(figure, "same", "m")


def test_pictures_are_embedded():
    pixels = np.zeros((4, 5, 3), dtype=np.uint8)
    assert photograph(pixels).startswith("data:image/jpeg;base64,/9j/")

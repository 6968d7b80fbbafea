"""The report is one file that needs nothing else and can be read by everyone."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from hmtb_twin import TwinError
from scenarios.drawing import png, svg
from scenarios.errors import ScenarioError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.findings import findings
from scenarios.thesis.report import root, write_report

VOID = {"meta", "img", "br", "link", "hr", "input"}


class Page(HTMLParser):
    """Collects what the tests ask of a page; unbalanced tags are an error."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def text(study: Comparison, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    assert write_report(study, findings(study), path) == path
    return path.read_text(encoding="utf-8")


def test_nothing_is_loaded_from_anywhere(text: str) -> None:
    page = Page(text)
    assert not page.of("script")
    assert not page.of("link")
    for _, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "srcset", "action"):
            target = attributes.get(name)
            assert target is None or target.startswith(("#", "data:image/png;base64,")), target
    assert "@import" not in text
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))
    allowed = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert set(re.findall(r"https?://[^\s\"'<)]+", text)) <= allowed


def test_every_figure_has_words_and_every_mark_is_unique(text: str) -> None:
    page = Page(text)
    drawings = page.of("svg")
    assert len(drawings) > 30
    assert all(entry.get("role") == "img" and len(str(entry.get("aria-label"))) > 20 for entry in drawings)
    assert all(len(str(entry.get("alt"))) > 20 for entry in page.of("img"))
    marks = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(marks) == len(set(marks))
    used = set(re.findall(r"url\(#([^)]+)\)", text)) | set(re.findall(r'xlink:href="#([^"]+)"', text))
    assert used <= set(marks)
    numbers = [int(number) for number in re.findall(r"<figcaption>Figure (\d+)\.", text)]
    assert numbers == list(range(1, len(drawings) + 1))


def test_contents_lead_to_sections_with_headings(text: str) -> None:
    page = Page(text)
    sections = [entry["id"] for entry in page.of("section")]
    assert [entry["href"] for entry in page.of("a")] == [f"#{name}" for name in sections]
    assert len(page.of("h1")) == 1
    assert len(page.of("h2")) == len(sections)
    assert sections[0] == "answer"
    assert page.of("html")[0]["lang"] == "en"


def test_the_answer_stands_in_the_table(text: str, study: Comparison) -> None:
    for entry in study.joints.values():
        assert f"{entry.truth.bandwidth_hz:.3f}" in text
        for model in entry.models.values():
            assert f"{model.ci95[0]:.3f} – {model.ci95[1]:.3f}" in text
    assert not re.findall(
        r"\bnan\b|\binf\b|Undefined|None", re.sub(r"<svg.*?</svg>|data:image[^\"]*", "", text, flags=re.S)
    )


def test_every_finding_is_listed_and_the_untried_have_no_number(text: str) -> None:
    rows = re.findall(r"<tr><td class=\"nowrap\"><strong>(F\d+)</strong>.*?</tr>", text, flags=re.S)
    assert rows == [f"F{number}" for number in range(1, 27)]
    assert text.count(">not tried</span>") == 5


def test_short_records_are_marked(text: str) -> None:
    assert "Records of 24 s: a look, not a result" in text
    assert "(quick run)</title>" in text
    assert text.count('<p class="quick">') == 2
    assert "stands on the twin" not in text


def test_the_report_says_how_to_get_a_row_again(text: str) -> None:
    assert "hmtb identify siso-5-shoulder_yaw.nc --method armax --orders 5 3 5 2 --skip 4" in text
    assert "hmtb simulate siso-5-shoulder_yaw --duration 24 --seed 11" in text


def test_it_is_light(text: str) -> None:
    assert len(text.encode()) < 15e6


def test_without_opengl_a_line_says_what_to_install(
    study: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_opengl(*_: object, **__: object) -> None:
        raise TwinError("no OpenGL here, install libegl1")

    monkeypatch.setattr("scenarios.thesis.report.render", no_opengl)
    monkeypatch.setattr("scenarios.thesis.report.svg", lambda figure, description, mark: "<svg></svg>")
    page = write_report(study, findings(study), tmp_path / "report.html").read_text(encoding="utf-8")
    assert "No OpenGL here, install libegl1" in page
    assert not Page(page).of("img")


def test_an_unwritable_report_is_refused(study: Comparison, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="cannot write the report"):
        write_report(study, (), tmp_path / "missing" / "report.html")


def test_svg_escapes_its_description_and_keeps_its_own_marks() -> None:
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])
    text = svg(figure, 'a < b & "c"', "m")
    assert 'aria-label="a &lt; b &amp; &quot;c&quot;"' in text
    assert all(mark.startswith("m-") for mark in re.findall(r'\bid="([^"]+)"', text))
    assert "<metadata>" not in text
    assert svg(figure, "same", "m") == svg(figure, "same", "m")


def test_png_is_embedded() -> None:
    assert png(np.zeros((4, 5, 3), dtype=np.uint8)).startswith("data:image/png;base64,iVBOR")


def test_roots_as_text() -> None:
    assert root(0.5 + 0j) == "0.500"
    assert root(0.5 - 0.25j) == "0.500 − 0.250j"


def test_whole_records_are_not_marked(study: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenarios.thesis.report.svg", lambda figure, description, mark: "<svg></svg>")
    whole = replace(study, duration=None)
    page = write_report(whole, findings(study), tmp_path / "report.html").read_text(encoding="utf-8")
    Page(page)
    assert "quick run" not in page.lower()
    assert "Interval holds the truth:" in page

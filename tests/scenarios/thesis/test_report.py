"""The report is one file that needs nothing else and can be read by everyone."""

import re
from dataclasses import replace
from itertools import pairwise

import pytest

from scenarios.report.figures import Gallery
from scenarios.thesis.finding import Verdict
from scenarios.thesis.findings import findings
from scenarios.thesis.frequencies import ORDER, chance
from scenarios.thesis.number_text import limits
from scenarios.thesis.report import html, write_report
from scenarios.thesis.results import answers, headline
from scenarios.thesis.tally import Tally, outcome
from tests.refusals import refused
from tests.scenarios.web_page import Page


@pytest.fixture(scope="module")
def text(report):
    return html(report.context)


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def test_nothing_is_loaded_from_anywhere(page, text):
    assert not page.of("script")
    assert not page.of("link")
    for _, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "srcset", "action"):
            target = attributes.get(name)
            assert target is None or target.startswith(("#", "data:image/jpeg;base64,")), target
    assert "@import" not in text
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))
    allowed = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert set(re.findall(r"https?://[^\s\"'<)]+", text)) <= allowed


def test_every_figure_has_words_and_every_mark_is_unique(page, text):
    drawings = page.of("svg")
    assert len(drawings) > 30
    assert all(entry.get("role") == "img" and len(str(entry.get("aria-label"))) > 20 for entry in drawings)
    assert all(len(str(entry.get("alt"))) > 20 for entry in page.of("img"))
    assert len(page.marks) == len(set(page.marks))
    used = set(re.findall(r"url\(#([^)]+)\)", text)) | set(re.findall(r'xlink:href="#([^"]+)"', text))
    assert used <= set(page.marks)
    numbers = [int(number) for number in re.findall(r"<figcaption>Figure (\d+)\.", text)]
    assert numbers == list(range(1, len(drawings) + 1))


def test_contents_lead_to_sections_with_headings(page, text):
    sections = [entry["id"] for entry in page.of("section")]
    links = [str(entry["href"]) for entry in page.of("a")]
    assert {link.removeprefix("#") for link in links} <= set(page.marks)
    for menu in re.findall(r"<nav.*?</nav>", text, flags=re.S):
        assert re.findall(r'href="#([^"]+)"', menu) == sections
    assert text.count("<nav") == 3
    assert text.index('id="answer"') < text.index('<nav class="contents printed"') < text.index('id="findings"')
    assert len(page.of("h2")) == len(sections)
    assert sections[:2] == ["answer", "findings"]
    assert sections[-2:] == ["provenance", "reproduce"]
    assert page.of("html")[0]["lang"] == "en"


def test_headings_leave_no_level_out(text):
    levels = [int(level) for level in re.findall(r"<h([1-6])[ >]", text)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(later - earlier <= 1 for earlier, later in pairwise(levels))


def test_every_table_has_a_caption_and_cells_have_headers(text):
    tables = re.findall(r"<table>.*?</table>", text, flags=re.S)
    assert len(tables) > 8
    bare = [re.sub("<[^>]+>", " ", table)[:80] for table in tables if "<caption>" not in table]
    assert not bare
    assert all(re.findall(r"<th(?=[ >])(?![^>]*scope=)[^>]*>", table) == [] for table in tables)


def test_every_figure_of_the_thesis_has_its_counterpart(text):
    section = text[text.index('<section id="figure-map">') :]
    without = re.findall(r'<span class="whole">(\w+): <strong>none', section)
    assert not without, f"no counterpart of figures {', '.join(without)} of the thesis"
    drawn = {f"#{mark}" for mark in re.findall(r'<figure id="(figure-\d+)"', text)}
    linked = set(re.findall(r'href="(#figure-\d+)"', section))
    assert linked <= drawn
    assert len(linked) > 60


def test_the_answer_stands_in_the_table(text, study):
    for entry in study.joints.values():
        assert f"{entry.truth.bandwidth_hz:.3f}" in text
        for model in entry.models.values():
            assert f"{model.ci95[0]:.3f} – {model.ci95[1]:.3f}" in text
    assert not re.findall(
        r"\bnan\b|\binf\b|Undefined|None", re.sub(r"<svg.*?</svg>|data:image[^\"]*", "", text, flags=re.S)
    )


def test_every_finding_is_listed_with_verdict_and_reason(text, study):
    rows = re.findall(r'<tr id="(F\d+)">(.*?)</tr>', text, flags=re.S)
    assert [key for key, _ in rows] == [f"F{number}" for number in range(1, 27)]
    for (_, row), finding in zip(rows, findings(study), strict=True):
        assert f">{finding.verdict}</span>" in row
        assert len(row[row.index('data-label="Why"') :]) > 30


def test_frequencies_and_ranges_stand_beside_the_findings(text, study, report):
    decided = findings(study)
    first, second = decided[0], decided[1]
    here = outcome(study, decided)
    turned: Verdict = "partly" if second.verdict != "partly" else "reproduced"
    moved = {name: 1.1 * value for name, value in here.numbers[first.key].items()}
    other = replace(
        here,
        seed=12,
        verdicts={**here.verdicts, second.key: turned},
        numbers={**here.numbers, first.key: moved},
    )
    both = Tally((here, other), {})
    many = html({**report.context, "chance": chance(decided, both, study.seed)})
    Page(many)
    rows = dict(re.findall(r'<tr id="(F\d+)">(.*?)</tr>', many, flags=re.S))
    assert '<span class="note">same on 2 of 2 seeds</span>' in rows[first.key]
    for spread in both.spread(first.key).values():
        assert limits(spread, first) in rows[first.key]
    assert any(limits(spread, first) for spread in both.spread(first.key).values())
    counts = [f"1 {verdict}" for verdict in sorted((turned, second.verdict), key=ORDER.index)]
    assert f"depends on the seed: of 2 seeds {', '.join(counts)}" in rows[second.key]
    assert "What another seed changes" in many
    assert "of 2 seeds (11 to 12) on the same arm, records of 24 s, run for this report." in many
    assert "depends on the seed: of" not in text, "nothing is said of seeds where there were none"
    assert "What another seed changes" not in text


def test_short_records_are_marked(text):
    assert "Records of 24 s: a look, not a result" in text
    assert "(quick run)</title>" in text
    assert text.count('<p class="quick">') == 2
    assert "stands on the twin" not in text


def test_the_report_says_how_to_get_a_row_again(text):
    assert "hmtb identify siso-5-shoulder_yaw.nc --method armax --orders 5 3 3 2 --skip 4" in text
    assert "hmtb simulate siso-5-shoulder_yaw --duration 24 --seed 11" in text


def test_it_is_light(text):
    assert len(text.encode()) < 15e6


def test_the_report_is_written_whole_with_its_cost(study, report, tmp_path, monkeypatch):
    messages: list[object] = []

    def drawn_already(*arguments: object) -> dict[str, object]:
        messages.extend(arguments)
        return dict(report.context)

    monkeypatch.setattr("scenarios.thesis.report.context", drawn_already)
    path = write_report(study, (), tmp_path / "report.html", figures=tmp_path)
    assert path == tmp_path / "report.html"
    gallery = messages[2]
    assert isinstance(gallery, Gallery)
    assert gallery.folder == tmp_path
    row = re.search(r"All of it</th><td>([\d.]+) s", path.read_text(encoding="utf-8"))
    assert float(row[1]) >= round(study.cost.total_s, 1)


def test_an_unwritable_report_is_refused_before_it_is_drawn(study, tmp_path):
    refused("there is no folder", write_report, study, (), tmp_path / "missing" / "report.html")
    refused("is a folder", write_report, study, (), tmp_path)


def test_whole_records_are_not_marked(study, report):
    main, *rest = study.campaigns
    whole = replace(study, campaigns=(replace(main, duration=None), *rest))
    text = html({**report.context, "study": whole, "headline": headline(whole), "answers": answers(whole)})
    Page(text)
    assert "quick run" not in text.lower()
    assert "Agrees with the best linear truth:" in text

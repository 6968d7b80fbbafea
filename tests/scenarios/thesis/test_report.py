"""The report is one file that needs nothing else and can be read by everyone."""

import base64
import csv
import gzip
import json
import re
from dataclasses import replace
from itertools import pairwise

import pytest
from markupsafe import escape
from plotly.offline import get_plotlyjs

from scenarios.thesis.answer import answer_texts
from scenarios.thesis.finding import CLAIMS, UNDECIDED, Verdict
from scenarios.thesis.findings import findings
from scenarios.thesis.frequencies import ORDER, chance
from scenarios.thesis.monte_carlo import Tally, outcome
from scenarios.thesis.motion_section import read_motion
from scenarios.thesis.report import html, limits, write_report
from tests.refusals import refused
from tests.scenarios.web_page import Page


@pytest.fixture(scope="module")
def rendered(report):
    return html(report)


@pytest.fixture(scope="module")
def text(rendered):
    return str(rendered[0])


@pytest.fixture(scope="module")
def tables(rendered):
    return rendered[1]


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def test_nothing_is_loaded_from_anywhere(page, text):
    assert all("src" not in attributes for attributes in page.of("script"))
    assert not page.of("link")
    for _, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "srcset", "action"):
            target = attributes.get(name)
            kinds = ("#", "data:image/jpeg;base64,", "data:video/mp4;base64,", "tables/")
            assert target is None or target.startswith(kinds), target
    assert "@import" not in text
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))
    assert "http" not in re.sub(r'<script type="application.*?</script>', "", text, flags=re.S)


def test_every_figure_has_words_data_and_a_number(page, text, report):
    plots = [entry for entry in page.of("figure") if "data-chart" in entry]
    assert next(entry["data-chart"] for entry in plots) == "answer"
    charts = json.loads(re.search(r'id="charts">(.*?)</script>', text, flags=re.S)[1])
    assert {entry["data-chart"] for entry in plots} == set(charts) == set(report.figures)
    assert all(len(str(entry.get("aria-label"))) > 20 for entry in page.of("div") if entry.get("class") == "plot")
    assert all(len(str(entry.get("alt"))) > 20 for entry in page.of("img"))
    assert len(page.marks) == len(set(page.marks))
    numbers = [int(number) for number in re.findall(r"<figcaption>Figure (\d+)\.", text)]
    assert numbers == list(range(1, len(plots) + 1))


def test_the_script_unpacks_plotly(text):
    packed = re.search(r'id="plotly">(.*?)</script>', text, flags=re.S)[1]
    assert gzip.decompress(base64.b64decode(packed)).decode() == get_plotlyjs()


def test_contents_lead_to_sections_with_headings(page, text):
    sections = [entry["id"] for entry in page.of("section")]
    links = [str(entry["href"]) for entry in page.of("a")]
    assert {link.removeprefix("#") for link in links if link.startswith("#")} <= set(page.marks)
    for menu in re.findall(r"<nav.*?</nav>", text, flags=re.S):
        assert re.findall(r'href="#([^"]+)"', menu) == sections
    assert text.count("<nav") == 3
    assert text.index('id="answer"') < text.index('<nav class="contents printed"') < text.index('id="findings"')
    assert len(page.of("h2")) == len(sections)
    assert sections[:3] == ["answer", "bandwidths", "findings"]
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
    drawn = {f"#{mark}" for mark in re.findall(r'<figure id="(figure-\d+)"', text)}
    linked = set(re.findall(r'href="(#figure-\d+)"', section))
    assert linked <= drawn
    assert len(linked) > 10


def test_long_tables_are_files_that_the_page_names(text, tables):
    assert set(re.findall(r'href="tables/([a-z-]+)\.csv"', text)) == set(tables.texts)
    rows = {name: list(csv.reader(content.splitlines())) for name, content in tables.texts.items()}
    assert all(len({len(row) for row in table}) == 1 for table in rows.values()), "every row has every column"
    assert rows["every-data-set"][0][:4] == ["", "Record", "Structure", "Excited"]
    assert {row[0] for row in rows["every-data-set"][1:]} == {"shoulder yaw", "shoulder pitch", "elbow pitch"}
    assert all("\u2212" not in content for content in tables.texts.values())
    numbers = [row[1].split(":")[0] for row in rows["records"][1:] if row[0] == "One joint at a time"]
    assert (numbers, len(rows["records"])) == ([str(n) for n in range(1, 9)], 1 + 8 + 15)


def test_the_answer_stands_in_the_table(text, study):
    for entry in study.joints.values():
        assert f"{entry.truth.bandwidth_hz:.3f}" in text
        for model in entry.models.values():
            assert f"{model.ci95[0]:.3f} – {model.ci95[1]:.3f}" in text
    bare = re.sub(r"<script.*?</script>|data:(image|video)[^\"]*", "", text, flags=re.S)
    assert not re.findall(r"\bnan\b|\binf\b|Undefined|None(?!:)", bare)


def test_every_finding_is_listed_with_verdict_and_reason(text, study):
    rows = re.findall(r'<tr id="(F\d+)">(.*?)</tr>', text, flags=re.S)
    assert [key for key, _ in rows] == list(CLAIMS)
    for (_, row), finding in zip(rows, findings(study), strict=True):
        assert f">{finding.verdict}</span>" in row
        assert len(row[row.index('data-label="Why"') :]) > 30


def test_claims_that_the_twin_cannot_decide_are_listed_with_the_reason(text):
    table = text[text.index("Claims without a verdict") :]
    for entry in UNDECIDED:
        assert f"<td>{escape(entry.claim)}</td><td>{entry.where}</td><td>{escape(entry.why)}</td>" in table


def test_frequencies_and_ranges_stand_beside_the_findings_of_unmarked_whole_records(text, study, report):
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
    main, *rest = study.campaigns
    whole = replace(study, campaigns=(replace(main, duration=None), *rest))
    many = str(html(replace(report, study=whole, other_seeds=chance(decided, both, study.seed)))[0])
    Page(many)
    assert "quick run" not in many.lower()
    rows = dict(re.findall(r'<tr id="(F\d+)">(.*?)</tr>', many, flags=re.S))
    assert '<span class="note">same on 2 of 2 seeds</span>' in rows[first.key]
    for spread in both.spread(first.key).values():
        assert limits(spread, first) in rows[first.key]
    assert any(limits(spread, first) for spread in both.spread(first.key).values())
    counts = [f"1 {verdict}" for verdict in sorted((turned, second.verdict), key=ORDER.index)]
    assert f"depends on the seed: of 2 seeds {', '.join(counts)}" in rows[second.key]
    assert "What another seed changes" in many
    against = chance(decided, both, study.seed)["against"]
    listed = many[many.index('<section id="shortcomings">') :]
    assert all(f'<li><a href="#{key}">' in listed for key in against)
    assert "of 2 seeds (11 to 12) on the same arm, records of 24 s, run for this report." in many
    assert "depends on the seed: of" not in text, "nothing is said of seeds where there were none"
    assert "What another seed changes" not in text


def test_short_records_are_marked(text):
    assert "(quick run)</title>" in text
    assert len(re.findall(r'<p class="quick">(?!The figures)', text)) == 2


def test_the_report_says_how_to_get_a_row_again(text):
    assert "hmtb identify siso-5-shoulder_yaw.nc --method armax --orders 5 3 3 2 --skip 4" in text
    assert "hmtb simulate siso-5-shoulder_yaw --duration 24 --seed 11" in text


def test_it_is_light(text):
    assert len(text.encode()) < 6e6


def test_the_report_is_written_whole_with_its_tables_and_cost(study, answer, report, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.thesis.report.report_contents", lambda *_, **__: report)
    path = write_report(study, (), answer, tmp_path / "report.html")
    assert path == tmp_path / "report.html"
    row = re.search(r"All of it</th><td>([\d.]+) s", path.read_text(encoding="utf-8"))
    assert float(row[1]) >= round(study.cost.total_s, 1)
    assert (tmp_path / "tables" / "parameters.csv").read_text(encoding="utf-8").startswith("Part,Parameter,Value")


def test_an_unwritable_report_is_refused_before_it_is_drawn(study, tmp_path):
    refused("there is no folder", write_report, study, (), None, tmp_path / "missing" / "report.html")
    refused("is a folder", write_report, study, (), None, tmp_path)


def test_the_first_screen_is_four_answers_and_a_picture(text, answer):
    first = text[text.index('<section id="answer">') : text.index('<section id="bandwidths">')]
    assert re.findall(r"<p>(.*?)</p>", re.sub("</?strong>", "", first)) == [
        escape(one) for one in answer_texts(answer, read_motion())[:4]
    ]
    assert first.count("<figure") == 1

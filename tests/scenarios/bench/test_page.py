"""The page: its words, its drawings, what keeps it shut to what results say."""

import json
import math
import re
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from scenarios.bench.leaderboard_page import context, html, markdown
from scenarios.bench.leaderboard_rows import RULE, LeaderboardRow, ranked
from scenarios.bench.result import Result

VOID = ("meta", "br", "img", "link", "input", "hr")


class Reader(HTMLParser):
    """Tags, attributes and the text of scripts; complains of what is not closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str | None]] = []
        self.texts: dict[str, list[str]] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value) for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.setdefault(self.open[-1] if self.open else "", []).append(data)


SPLIT = ("figures", "amplitude_split", "curves", "shoulder_yaw")


ODD: tuple[tuple[tuple[Any, ...], object], ...] = (
    ((*SPLIT, "mrad", 0), math.inf),
    (("figures", "amplitude_split", "curves", "elbow_pitch", "mrad", 0), 1e308),
    ((*SPLIT, "systematic", 2), 1e308),
    ((*SPLIT, "noise", 2), 5e-324),
    ((*SPLIT, "systematic_interval", 0), [0, 10**400]),
    (("figures", "frequency_response", "curves", "p2", "relative_error_percent"), 10**400),
    (("figures", "frequency_response", "curves", "p3", "relative_error_percent"), 1e308),
    (("figures", "bandwidth", "curves", "classes", 0, "best_linear"), 10**400),
    (("figures", "bandwidth", "curves", "about_1_hz"), [-1e308, 1e308]),
    (("figures", "efficiency", "parts", 0, "value"), 1e308),
    (("figures", "efficiency", "parts", 1, "expected"), 1e308),
    (("figures", "efficiency", "parts", 2, "limits"), [-1e308, 1e308]),
    (("figures", "bias", "parts", 0, "interval"), [-1e308, 1e308]),
    (("figures", "speed", "parts", 0, "value"), 1e308),
)


@pytest.mark.slow
@pytest.mark.parametrize("chosen", [ODD[::2], ODD[1::2]])
@pytest.mark.filterwarnings("error")
def test_numbers_that_no_axis_can_hold_are_left_out_of_drawings(
    results: tuple[Result, ...], chosen: tuple[tuple[tuple[Any, ...], object], ...], tmp_path: Path
) -> None:
    table = json.loads(results[0].to_json())
    for keys, value in chosen:
        place = table
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value
    path = tmp_path / "odd.json"
    path.write_text(json.dumps(table), encoding="utf-8")
    read(html(context(ranked([path]))))


@pytest.fixture(scope="module")
def pages(
    results: tuple[Result, ...], tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, str, Sequence[LeaderboardRow]]:
    folder = tmp_path_factory.mktemp("results")
    for number, made in enumerate(one for one in results if one.contestant.name not in ("okid", "n4sid", "armax")):
        (folder / f"{number}.json").write_text(made.to_json(), encoding="utf-8")
    entries = ranked([folder])
    shown = context(entries)
    return html(shown), markdown(shown), entries


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


@pytest.mark.slow
def test_the_page_is_well_formed_and_loads_nothing(pages: tuple[str, str, Sequence[LeaderboardRow]]) -> None:
    reader = read(pages[0])
    marks = [value for _, name, value in reader.attributes if name == "id"]
    assert len(marks) == len(set(marks))
    links = [value for tag, name, value in reader.attributes if name in ("href", "xlink:href", "src")]
    assert links
    assert all(value and value.startswith("#") and value[1:] in marks for value in links)
    # Names of XML are no addresses.
    assert "://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", pages[0])


def test_no_script_but_its_own_can_run(pages: tuple[str, str, Sequence[LeaderboardRow]]) -> None:
    reader = read(pages[0])
    (script,) = reader.texts["script"]
    digest = b64encode(sha256(script.encode()).digest()).decode()
    (policy,) = (value for _, name, value in reader.attributes if name == "content" and value and "script-src" in value)
    assert policy.split("script-src ")[1] == f"'sha256-{digest}'"
    assert "default-src 'none'" in policy
    assert not [name for _, name, _ in reader.attributes if name.startswith("on")]
    assert "alert" not in script
    assert "&lt;script&gt;alert(" in pages[0]


def test_what_results_say_is_text_in_markdown(pages: tuple[str, str, Sequence[LeaderboardRow]]) -> None:
    text = pages[1]
    # In a block of code nothing but its fence means anything.
    words = re.sub(r"^(```+)sh\n.*\n\1$", "", text, flags=re.M)
    assert words.count("```") == 0
    assert "<script" not in words
    assert "](javascript" not in words
    assert "\u202e" not in text + pages[0]
    tables = [line for line in text.splitlines() if line.startswith("|")]
    counts = [len(re.findall(r"(?<!\\)\|", line)) for line in tables]
    at = 0
    for length in (len(list(group)) for group in _tables(text)):
        assert len(set(counts[at : at + length])) == 1
        at += length
    assert at == len(tables) > 50


def _tables(text: str) -> list[list[str]]:
    return [block.splitlines() for block in re.findall(r"(?:^\|.*\n)+", text, re.M)]


def test_rows_stand_in_order_and_the_page_says_by_what(pages: tuple[str, str, Sequence[LeaderboardRow]]) -> None:
    page, text, entries = pages
    names = [entry.name for entry in entries]
    assert names[1] == "oe"
    assert names[-1] == "one_sample_late"
    assert RULE in text
    first = page.split('<table class="sortable">')[1].split("</table>")[0]
    assert re.findall(r'href="#estimator-(\d+)"', first) == [str(n) for n in range(1, 5)]


def test_the_rule_of_the_response_error_and_who_has_none_are_told(
    pages: tuple[str, str, Sequence[LeaderboardRow]],
) -> None:
    for page in (pages[0], pages[1].replace("\\", "")):
        assert "median over the problems that were asked of all rows (p2, p3, p4, p5); “–” where an estimator" in page
        assert "answered too few records of p2, p3, p4, p5 for a verdict: no response error" in page
    (caption,) = re.findall(r"<figcaption>Figure 1\. (.*?)</figcaption>", pages[0], re.S)
    assert "asked of all rows (p2, p3, p4, p5)" in caption
    assert "Not drawn, since a number of theirs is missing: &lt;script&gt;" in caption


def test_verdicts_are_told_by_sign_and_word(pages: tuple[str, str, Sequence[LeaderboardRow]]) -> None:
    page = pages[0]
    for sign, word in (("✓", "passes"), ("✗", "fails"), ("△", "fails as theory says"), ("–", "no verdict")):
        assert f'<span aria-hidden="true">{sign}</span><span class="unseen">{word}</span>' in page
        assert f"{sign} {word}" in pages[1]


def test_every_estimator_has_its_command_and_reasons(pages: tuple[str, str, Sequence[LeaderboardRow]]) -> None:
    page, text, _ = pages
    assert page.count('<pre class="command">') == 4
    assert "hmtb verify my_module:oe --name &#39;oe&#39; --seed 7" in page
    assert "hmtb verify my_module:oe --name 'oe' --seed 7" in text
    assert page.count("under a coloured disturbance output error is not efficient [Ljung1999, theorem 8.4]") >= 3
    assert "ab" * 32 in page
    assert "873 × <code>" in page
    assert "nan" not in re.sub(r"<svg.*?</svg>|<style>.*?</style>", "", page, flags=re.S).lower().replace("nano", "")


def test_drawings_stand_with_their_figures(pages: tuple[str, str, Sequence[LeaderboardRow]], tmp_path: Path) -> None:
    page = pages[0]
    captions = re.findall(r"<figcaption>Figure (\d+)\. (.{40})", page)
    assert [int(number) for number, _ in captions] == list(range(1, len(captions) + 1))
    told = " ".join(text for _, text in captions)
    for start in (
        "Accuracy against time",
        "Efficiency",
        "Coverage",
        "Error of the frequency",
        "Bias",
        "Errors of the response on the arm",
        "Bandwidths",
    ):
        assert start in told

"""The page: its words, its drawings, what keeps it shut to what results say."""

import json
import math
import re
from base64 import b64encode
from hashlib import sha256

import pytest

from scenarios.bench.leaderboard import ranked
from scenarios.bench.leaderboard_page import context, html, markdown
from scenarios.bench.leaderboard_words import ORDERS_GIVEN, RULE
from scenarios.files.errors import ScenarioError
from tests.scenarios.bench.judging import changed
from tests.scenarios.web_page import Page

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow

SPLIT = "figures amplitude_split curves shoulder_yaw"
RESPONSE = "figures frequency_response curves"
ODD = (
    (f"{SPLIT} mrad 0", math.inf),
    ("figures amplitude_split curves elbow_pitch mrad 0", 1e308),
    (f"{SPLIT} systematic 2", 1e308),
    (f"{SPLIT} noise 2", 5e-324),
    (f"{SPLIT} systematic_interval 0", [0, 1e308]),
    (f"{RESPONSE} p2 relative_error_percent", 1e200),
    (f"{RESPONSE} p3 relative_error_percent", 1e308),
    ("figures bandwidth parts 0 value", 1e308),
    ("figures bandwidth parts 1 interval", [-1e308, 1e308]),
    ("figures efficiency parts 0 value", 1e308),
    ("figures efficiency parts 1 expected", 1e308),
    ("figures efficiency parts 2 limits", [-1e308, 1e308]),
    ("figures bias parts 0 interval", [-1e308, 1e308]),
    ("figures speed parts 0 value", 1e308),
)


@pytest.mark.thorough
@pytest.mark.parametrize("chosen", [ODD[::2], ODD[1::2]])
@pytest.mark.filterwarnings("error")
def test_numbers_that_no_axis_can_hold_are_left_out_of_drawings(results, chosen, tmp_path):
    path = changed(json.loads(results[0].to_json()), chosen, tmp_path / "odd.json")
    Page(html(context(ranked([path]))))


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (f"{SPLIT} mrad 0", 0.0, "mrad has numbers that are not above 0"),
        (f"{SPLIT} noise", [1.0, 2.0], "its arrays differ in length"),
        (f"{SPLIT} noise_interval", [1.0, 2.0, 3.0], "noise_interval has 1 dimensions, expected 2"),
        (SPLIT, 3, "not subscriptable"),
        (f"{RESPONSE} p2 error", None, "error has 0 dimensions, expected 3"),
        ("figures bandwidth curves classes", [{}], "drawing bandwidth are damaged .*missing label"),
        ("figures bandwidth curves classes 0 hz", 1.0, "hz must be a list of numbers"),
        ("figures bandwidth curves classes 0 near", "two", "near must be a whole number"),
    ],
)
def test_a_result_with_damaged_numbers_for_drawings_is_refused(results, place, value, message, tmp_path):
    path = changed(json.loads(results[0].to_json()), [(place, value)], tmp_path / "odd.json")
    with pytest.raises(ScenarioError, match=rf"odd\.json is no result of hmtb verify: .*{message}"):
        ranked([path])


@pytest.fixture(scope="module")
def pages(originals):
    """Of the estimators that are late, with a coloured disturbance, with a long name and with a hostile one."""
    board = ranked([originals / f"{number}.json" for number in (0, 2, 5, 6)])
    shown = context(board)
    return html(shown), markdown(shown), board


def test_the_page_is_well_formed_loads_nothing_and_runs_no_script_but_its_own(pages):
    page = Page(pages[0])
    marks = set(page.marks)
    assert len(page.marks) == len(marks)
    attributes = [pair for _, pairs in page.tags for pair in pairs.items()]
    links = [value for name, value in attributes if name in ("href", "xlink:href", "src")]
    assert links
    assert all(value and value.startswith("#") and value[1:] in marks for value in links)
    # Names of XML are no addresses.
    assert "://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", pages[0])
    (script,) = re.findall(r"<script>(.*?)</script>", pages[0], re.S)
    assert len(page.of("script")) == 1
    digest = b64encode(sha256(script.encode()).digest()).decode()
    (policy,) = (value for name, value in attributes if name == "content" and value and "script-src" in value)
    assert policy.split("script-src ")[1] == f"'sha256-{digest}'"
    assert "default-src 'none'" in policy
    assert not [name for name, _ in attributes if name.startswith("on")]
    assert "alert" not in script
    assert "&lt;script&gt;alert(" in pages[0]


def test_what_results_say_is_text_in_markdown(pages):
    text = pages[1]
    # In a block of code nothing but its fence means anything.
    words = re.sub(r"^(```+)sh\n.*\n\1$", "", text, flags=re.M)
    assert words.count("```") == 0
    assert "<script" not in words and "](javascript" not in words
    assert "\u202e" not in text + pages[0]
    tables = re.findall(r"(?:^\|.*\n)+", text, re.M)
    assert len(tables) > 10
    for lines in map(str.splitlines, tables):
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1


def test_rows_stand_in_order_and_the_rules_are_written(pages):
    page, text, board = pages
    assert board.rows[1].name == "oe" and board.rows[-1].name == "one_sample_late"
    assert RULE in text and ORDERS_GIVEN in text and ORDERS_GIVEN in page
    first = page.split('<table class="sortable">')[1].split("</table>")[0]
    assert re.findall(r'href="#estimator-(\d+)"', first) == [str(n) for n in range(1, 5)]
    for words in (page, text.replace("\\", "")):
        assert "median over the problems that were asked of all rows (p2, p3, p4, p5); “–” where an estimator" in words
        assert "answered too few records of p2, p3, p4, p5 for a verdict: no response error" in words
    for sign, word in (("✓", "passes"), ("✗", "fails"), ("△", "fails as theory says"), ("–", "no verdict")):
        assert f'<span aria-hidden="true">{sign}</span><span class="unseen">{word}</span>' in page
        assert f"{sign} {word}" in text


def test_every_estimator_has_its_command_and_reasons(pages):
    page, text, _ = pages
    assert page.count('<pre class="command">') == 4
    assert "hmtb verify my_module:oe --name &#39;oe&#39; --seed 7" in page
    assert "hmtb verify my_module:oe --name 'oe' --seed 7" in text
    assert page.count("under a coloured disturbance output error is consistent in open loop, but not efficient") >= 3
    assert "ab" * 32 in page
    assert "873 × <code>" in page
    assert "nan" not in re.sub(r"<svg.*?</svg>|<style>.*?</style>", "", page, flags=re.S).lower().replace(
        "nan or infinite", ""
    )


def test_drawings_stand_with_their_figures(pages):
    captions = re.findall(r"<figcaption>Figure (\d+)\. (.*?)</figcaption>", pages[0], re.S)
    assert [int(number) for number, _ in captions] == list(range(1, len(captions) + 1))
    starts = ("Accuracy against time", "Efficiency", "Coverage", "Error of the frequency", "Errors of the response on")
    for start in (*starts, "Bias", "Bandwidths"):
        assert any(text.startswith(start) for _, text in captions)
    assert "asked of all rows (p2, p3, p4, p5)" in captions[0][1]
    assert "Not drawn, since a number of theirs is missing: &lt;script&gt;" in captions[0][1]

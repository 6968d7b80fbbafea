"""The sentences of docs/maps.md are those of the code."""

import re
from pathlib import Path

import pytest

from hmtb_twin import load_arm
from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.truth.map_findings import findings
from scenarios.truth.maps import Density, maps

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "maps.md").read_text(encoding="utf-8")

NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e-\d+)?")


@pytest.mark.slow
def test_small_signal_sentences_are_computed() -> None:
    """Those over amplitude and friction take a minute; the command at the head of the page renews them."""
    (block,) = re.findall(r"<!-- findings -->\n(.*?)<!-- end -->", PAGE, re.S)
    shown = [line.removeprefix("- ") for line in block.strip().splitlines()]
    texts = findings(maps(load_arm(), OPERATING_POSE, Density(amplitudes=())))
    assert len(shown) == len(texts) + 2
    for printed, text in zip(shown, texts, strict=False):
        assert NUMBER.sub("#", printed) == NUMBER.sub("#", text)
        # One step in the last digit is left to other compilers and processors.
        for given, new in zip(NUMBER.findall(printed), NUMBER.findall(text), strict=True):
            step = 10.0 ** -len(given.partition(".")[2]) if "e" not in given else float(given)
            assert float(given) == pytest.approx(float(new), abs=1.5 * step), printed


def test_readme_quotes_the_page() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (turn, amplitude) = re.findall(r"more than (\d+)°, and from ([\d.]+) rad", readme)[0]
    assert f"turn every joint at once by up to {turn}°" in PAGE
    assert len(re.findall(rf"(?:shoulder|elbow) \w+ from {amplitude} to", PAGE)) == 3

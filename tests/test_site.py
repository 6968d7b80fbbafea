"""The site of the documentation: built strictly, every public name in its reference, nothing from the network."""

import os
import re
import runpy
import subprocess
import sys
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import pytest

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow

pytest.importorskip("mkdocs")

ROOT = Path(__file__).parents[1]


class Addresses(HTMLParser):
    """Collects anchors, links, and what a page loads."""

    def __init__(self):
        super().__init__()
        self.anchors, self.links, self.loaded = set(), set(), set()

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.anchors.add(given.get("id"))
        if tag == "a":
            self.links.add(given.get("href"))
        elif tag in ("script", "img", "link", "iframe"):
            self.loaded.add(given.get("src") or given.get("href") or "")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Anchors, links and loaded files of each page of the site, by its path."""
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", folder]
    settings = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(list(map(str, words)), cwd=ROOT, env=settings, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {}
    for path in folder.rglob("*.html"):
        pages[str(path.relative_to(folder))] = page = Addresses()
        page.feed(path.read_text(encoding="utf-8"))
    return pages


@pytest.mark.pages
def test_every_public_name_is_in_the_reference(site):
    packages = [path.removeprefix("api/").removesuffix(".html") for path in site if path.startswith("api/")]
    assert {"sysid", "sysid.control", "hmtb_twin", "scenarios"} <= set(packages)
    for package in packages:
        page = site[f"api/{package}.html"]
        ends = {re.split(r"[.#]", one)[-1] for one in page.anchors | page.links if one}
        assert set(import_module(package).__all__) <= ends, package


@pytest.mark.pages
def test_pages_load_nothing_from_the_network(site):
    assert "parameters.html" in site
    for path, page in site.items():
        assert not [one for one in page.loaded if re.match(r"(https?:)?//", one)], path


def test_every_diagram_has_its_picture():
    """`make diagrams` draws them."""
    hooks = runpy.run_path(str(ROOT / "docs/site/diagrams.py"))
    pages = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}
    diagrams = [found["text"] for text in pages.values() for found in hooks["DIAGRAM"].finditer(text)]
    assert len(diagrams) == sum(text.count("```mermaid") for text in pages.values()) >= 4
    there = {path.name for path in (ROOT / "docs/images").glob("diagram-*.svg")}
    assert there == set(map(hooks["picture"], diagrams))
    assert "```mermaid" not in hooks["on_page_markdown"](pages["architecture.md"])

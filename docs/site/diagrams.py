"""Draw the Mermaid diagrams of the pages as pictures for the site, which loads no scripts from the network.

Run by `make diagrams`, which installs Mermaid with npm. A diagram begins with a comment, ``%% what it shows``. Its
picture is diagram-HASH.svg, named after the hash of its text, so that a test finds diagrams without picture.
"""

import re
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
DIAGRAM = re.compile(r"^```mermaid\n%% (?P<title>[^\n]+)\n(?P<text>.*?)^```\n", re.M | re.S)
OPTIONS = "{startOnLoad: false, theme: 'neutral', htmlLabels: false, flowchart: {htmlLabels: false, useMaxWidth: true}}"


def picture(text: str) -> str:
    """Return the file name of the picture of a diagram."""
    return f"diagram-{sha256(text.encode()).hexdigest()[:12]}.svg"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put pictures in the place of diagrams; mkdocs calls it."""
    return DIAGRAM.sub(lambda found: f"![{found['title']}](images/{picture(found['text'])})\n", markdown)


def main(mermaid: Path) -> None:
    """Draw all diagrams anew and remove pictures of those that are gone.

    Args:
        mermaid: The file mermaid.min.js of the package.
    """
    from playwright.sync_api import sync_playwright

    texts = [found["text"] for page in sorted(DOCS.glob("*.md")) for found in DIAGRAM.finditer(page.read_text("utf-8"))]
    folder = DOCS / "images"
    for old in folder.glob("diagram-*.svg"):
        old.unlink()
    with sync_playwright() as player:
        browser = player.chromium.launch(executable_path="/usr/bin/chromium")
        page = browser.new_page()
        page.add_script_tag(path=mermaid)
        page.evaluate(f"mermaid.initialize({OPTIONS})")
        for number, text in enumerate(texts):
            drawing = page.evaluate(
                "([name, text]) => mermaid.render(name, text).then(r => r.svg)", [f"d{number}", text]
            )
            # its own size and ground: legible on light and dark pages, and never drawn larger than it is
            size = 'width="{2}" height="{3}"'.format(*re.findall(r'viewBox="(\S+) (\S+) (\S+) (\S+)"', drawing)[0])
            drawing = drawing.replace('width="100%"', size, 1).replace('style="', 'style="background: white; ', 1)
            (folder / picture(text)).write_text(drawing + "\n", encoding="utf-8")
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))

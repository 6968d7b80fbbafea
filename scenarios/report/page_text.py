"""Text of a rendered page: numbered figures, minus signs, table of contents."""

import re

from markupsafe import Markup

Contents = tuple[tuple[str, tuple[tuple[str, str], ...]], ...]
"""Parts of the page by heading, each with the marks and headings of its sections."""


def numbered(body: str) -> str:
    """The page with its figures numbered as they stand on it, whatever the order in which they were drawn.

    Args:
        body: The page without its head, figures and links to them by the numbers of the gallery.
    """
    order = {old: str(new) for new, old in enumerate(re.findall(r'<figure id="figure-(\d+)"', body), 1)}
    pattern = r'(<figure id="figure-|href="#figure-|<figcaption>Figure |">figure )(\d+)(?=[".<])'
    return re.sub(pattern, lambda found: found[1] + order[found[2]], body)


def signed(body: str) -> str:
    """The page with true minus signs before its numbers, but for what is a drawing, code or inside a tag.

    Args:
        body: The page without its head.
    """
    pieces = re.split(r"(<svg\b.*?</svg>|<(?:pre|code)\b.*?</(?:pre|code)>|<[^>]*>)", body, flags=re.S)
    pieces[::2] = [re.sub(r"(?<![\w.)\]-])-(?=\d)", "−", text) for text in pieces[::2]]
    return "".join(pieces)


def contents(body: str) -> Contents:
    """The parts and sections of the page, read from the page itself so that no section can be left out.

    Args:
        body: The page without its head; a part begins with a paragraph of class `part`, a section with its heading.

    Returns:
        Parts in order; sections before the first part are in one without a name.
    """
    parts: list[tuple[str, list[tuple[str, str]]]] = [("", [])]
    pattern = r'<p class="part">(.*?)</p>|<section id="([^"]+)">\s*<h2>(.*?)</h2>'
    for part, mark, heading in re.findall(pattern, body, flags=re.S):
        if part:
            parts.append((Markup(part), []))
        else:
            parts[-1][1].append((mark, Markup(heading)))
    return tuple((name, tuple(sections)) for name, sections in parts if sections)

"""Figures and pictures: as files, and inside a page, where nothing is loaded from anywhere."""

import base64
import io
import re
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from hmtb_twin.files.atomic_write import replacing

SETTINGS: dict[Any, Any] = {
    "font.size": 9,
    "font.family": "DejaVu Sans",
    "svg.fonttype": "path",  # the page looks the same whatever fonts the reader has
    "svg.hashsalt": "hmtb",  # equal figures give equal text
    "path.simplify_threshold": 0.5,
}


def save_figure(figure: Figure, path: Path, dpi: int = 100) -> None:
    """Write a figure whole or not at all, in the format that its name ends in.

    Args:
        figure: The figure.
        path: The file; one of that name is replaced.
        dpi: Pixels per inch, of formats made of pixels.

    Raises:
        TwinError: There is a folder of that name.
        OSError: The file cannot be written.
    """
    file_format = path.suffix.removeprefix(".").lower()
    # Without a date equal figures give equal files.
    date_fields = {"svg": "Date", "pdf": "CreationDate"}
    metadata = {date_fields[file_format]: None} if file_format in date_fields else None
    with replacing(path) as partial:
        try:
            figure.savefig(partial, format=file_format, dpi=dpi, metadata=metadata)
        except ValueError:  # a name such as `u$\\q$` is no formula
            for label in figure.findobj(Text):
                label.set_parse_math(False)
            figure.savefig(partial, format=file_format, dpi=dpi, metadata=metadata)


def svg(figure: Figure, description: str, mark: str) -> str:
    """Turn a figure into an `<svg>` element that scales with the page.

    Args:
        figure: The figure.
        description: What it shows, for those who cannot see it.
        mark: Unique on the page; identifiers inside the element are prefixed with it.
    """
    buffer = io.StringIO()
    with matplotlib.rc_context(SETTINGS):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg_file = buffer.getvalue()
    # An XML declaration and a document type come first, which have no place inside a page.
    element = svg_file[svg_file.index("<svg") :]
    # A hundredth of a point is less than any eye sees, and the digits after it are a third of the page.
    element = re.sub(r'(\s(?:d|x|y)=")([^"]*)"', lambda m: m[1] + re.sub(r"(\.\d\d)\d+", r"\1", m[2]) + '"', element)
    # Identifiers of several figures would meet on one page.
    element = re.sub(r'\bid="|\bhref="#|\burl\(#', rf"\g<0>{mark}-", element)
    head, rest = element.split(">", 1)
    head = re.sub(r'\s(?:width|height|version)="[^"]*"', "", head)
    label = escape(description, quote=True)
    return f'{head} role="img" aria-label="{label}"><title>{escape(description)}</title>{rest}'


def photograph(picture: np.ndarray) -> str:
    """Turn a picture (height, width, 3), 8-bit RGB, into the address of an embedded JPEG, a tenth of the PNG's size."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="JPEG", quality=88)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


@dataclass(frozen=True)
class Picture:
    """A figure on the page; the page numbers figures as they stand on it.

    Attributes:
        name: Its name, once on the page.
        svg: The element.
        caption: What it shows and how to read it.
        shape: Width over height: what the page keeps free until the figure comes into view.
    """

    name: str
    svg: str
    caption: str
    shape: float


def picture(figure: Figure, caption: str, name: str, mark: str) -> Picture:
    """Turn a figure into a picture of a page.

    Args:
        figure: The figure.
        caption: What it shows and how to read it: also its description for those who cannot see it.
        name: Its name, once on the page.
        mark: Unique on the page, and short: identifiers inside the element are prefixed with it.
    """
    sentence = caption[:1].upper() + caption[1:]
    width, height = figure.get_size_inches()
    return Picture(name, svg(figure, sentence, mark), sentence, width / height)

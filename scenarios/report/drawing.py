"""Figures and pictures: as files, and as text inside a page, where nothing is loaded from anywhere."""

import base64
import io
import re
from html import escape
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from scenarios.files.atomic_write import replacing

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
        dpi: Pixels per inch of what is made of pixels.

    Raises:
        ScenarioError: There is a folder of that name.
        OSError: The file cannot be written.
    """
    kind = path.suffix.removeprefix(".").lower()
    dated = {"svg": "Date", "pdf": "CreationDate"}
    metadata = {dated[kind]: None} if kind in dated else None
    with replacing(path) as partial:
        figure.savefig(partial, format=kind, dpi=dpi, metadata=metadata)


def svg(figure: Figure, description: str, mark: str) -> str:
    """Turn a figure into an `<svg>` element that scales with the page.

    Args:
        figure: The figure.
        description: What it shows, for those who cannot see it.
        mark: Unique on the page; identifiers inside the element are prefixed with it.

    Returns:
        The element.
    """
    buffer = io.StringIO()
    with matplotlib.rc_context(SETTINGS):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    # A hundredth of a point is less than any eye sees, and the digits after it are a third of the page.
    text = re.sub(r'(\s(?:d|x|y)=")([^"]*)"', lambda m: m[1] + re.sub(r"(\.\d\d)\d+", r"\1", m[2]) + '"', text)
    # Identifiers of several figures would meet on one page.
    text = re.sub(r'\bid="([^"]+)"', rf'id="{mark}-\1"', text)
    text = re.sub(r'(xlink:href|href)="#([^"]+)"', rf'\1="#{mark}-\2"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{mark}-\1)", text)
    head, rest = text.split(">", 1)
    head = re.sub(r'\s(?:width|height|version)="[^"]*"', "", head)
    label = escape(description, quote=True)
    return f'{head} role="img" aria-label="{label}"><title>{escape(description)}</title>{rest}'


def png(picture: np.ndarray) -> str:
    """Turn a picture (height, width, 3), 8-bit RGB, into the address of an embedded PNG."""
    from matplotlib.image import imsave

    buffer = io.BytesIO()
    imsave(buffer, picture, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def photograph(picture: np.ndarray) -> str:
    """Turn a picture (height, width, 3), 8-bit RGB, into the address of an embedded JPEG, a tenth of the PNG's size."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="JPEG", quality=88)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")

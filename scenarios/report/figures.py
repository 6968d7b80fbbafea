"""The figures of the report, each with the figures of the thesis that it answers."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from scenarios.files.errors import ScenarioError
from scenarios.report.drawing import save_figure, svg


@dataclass(frozen=True)
class Picture:
    """A figure on the page.

    Attributes:
        number: In the order in which figures were drawn; the page numbers them as they stand on it.
        name: Its name as a file, without suffix: lower case, words apart by hyphens.
        svg: The element.
        caption: What it shows and how to read it.
        thesis: Figures of the thesis whose counterpart it is, e.g. ``("22", "A2", "A17")``.
        shape: Width over height: what the page keeps free until the figure comes into view.
    """

    number: int
    name: str
    svg: str
    caption: str
    thesis: tuple[str, ...]
    shape: float


class Gallery:
    """Takes the figures of the page.

    Args:
        folder: Where every figure is written as SVG and PNG too; nowhere if None.
        drawn: Called with the number of figures drawn after each.

    Raises:
        ScenarioError: There is no such folder.
    """

    def __init__(self, folder: Path | None = None, drawn: Callable[[int], None] | None = None) -> None:
        if folder is not None and not folder.is_dir():
            raise ScenarioError(f"no folder {str(folder)!r} for the figures; expected one that exists")
        self.folder = folder
        self._drawn = drawn or (lambda number: None)
        self.pictures: list[Picture] = []

    def add(self, figure: Figure, caption: str, *, name: str, thesis: Sequence[str] = ()) -> Picture:
        """Take a figure.

        Args:
            figure: The figure.
            caption: What it shows and how to read it: also its description for those who cannot see it.
            name: Its name as a file; each once.
            thesis: Figures of the thesis whose counterpart it is.

        Returns:
            The figure as the page holds it.

        Raises:
            ScenarioError: The name is no file name, or taken.
        """
        if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name) or any(entry.name == name for entry in self.pictures):
            raise ScenarioError(f"figure name {name!r}: expected words of a-z and 0-9 apart by hyphens, each name once")
        number = len(self.pictures) + 1
        _lay_out(figure)
        if self.folder is not None:
            for kind in ("svg", "png"):
                save_figure(figure, self.folder / f"{name}.{kind}", dpi=200)
        text = caption[:1].upper() + caption[1:]
        width, height = figure.get_size_inches()
        picture = Picture(number, name, svg(figure, text, f"f{number}"), text, tuple(thesis), width / height)
        self.pictures.append(picture)
        self._drawn(number)
        return picture

    def counterparts(self) -> Mapping[str, tuple[Picture, ...]]:
        """Pictures by figure of the thesis."""
        found: dict[str, tuple[Picture, ...]] = {}
        for picture in self.pictures:
            for entry in picture.thesis:
                found[entry] = (*found.get(entry, ()), picture)
        return found


def _lay_out(figure: Figure) -> None:
    """Place the axes once for all files made of a figure: finding the places takes longer than drawing."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")

"""List of identified models of a page: identified and drawn in a process of their own, kept whichever browser looks."""

from collections.abc import Callable

from scenarios.files.errors import ScenarioError
from scenarios.identification.file_identification import IdentificationRequest
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.model_display import IdentifiedModel, draw_figures, identify_request
from scenarios.jobs.work import Work
from sysid.plots import PALETTE, Style

IDENTIFICATION, FIGURES = "the identification", "the drawing"
"""Names of the work."""

COLOURS = tuple(name for name in (*ESTIMATORS, "tfest", "polyest", "welch", "cra") if name in PALETTE)
"""Styles of models; each is used once while there are any."""


class IdentifiedModels:
    """Identified models, each with its colour, and the figures that compare those that are visible.

    Args:
        work: Computes them.
        tell: Called after every change of these attributes.

    Attributes:
        listed: The models by number.
        hidden: Numbers of those that the figures leave out.
        beside: Which of `truth` and `published` the figures show beside them.
        selected: Number of the model whose numbers are shown.
        figures: Cards by name.
        failure: Why the last work failed; empty if it did not.
        revision: Number of changes so far.
    """

    def __init__(self, work: Work, tell: Callable[[], None]) -> None:
        self._work, self._tell = work, tell
        self._last, self.revision, self.selected = 0, 0, 0
        self.listed: dict[int, IdentifiedModel] = {}
        self.hidden: set[int] = set()
        self.beside: tuple[str, ...] = ("truth", "published")
        self.figures: dict[str, str] = {}
        self.failure = ""

    @property
    def busy(self) -> str:
        """The work of this list that is under way; empty if none is."""
        return self._work.label if self._work.label in (IDENTIFICATION, FIGURES) else ""

    def identify(self, request: IdentificationRequest) -> None:
        """Identify a model; returns at once.

        Raises:
            ScenarioError: Something is being computed.
        """
        self.failure = ""
        self._work.start(IDENTIFICATION, identify_request, request, done=self._identified, failed=self._failed)
        self._changed()

    def show(self, *, hidden: set[int], beside: tuple[str, ...]) -> None:
        """Draw the figures with other models."""
        self.hidden, self.beside = hidden, beside
        self._changed()
        self._work.when_free(FIGURES, self._draw)

    def select(self, number: int) -> None:
        """Choose the model whose numbers are shown."""
        self.selected = number
        self._changed()

    def remove(self, number: int) -> None:
        """Take a model from the list."""
        self.listed.pop(number, None)
        self.selected = max(self.listed, default=0)
        self.show(hidden=self.hidden - {number}, beside=self.beside)

    def _identified(self, model: IdentifiedModel) -> None:
        self.selected = self._last = self._last + 1
        self.listed[self._last] = model.renamed(f"{self._last}: {model.name}", self._unused_style(model.style))
        self._changed()
        # Another computation may have begun since: figures wait for it.
        self._work.when_free(FIGURES, self._draw)

    def _unused_style(self, preferred: Style) -> Style:
        """The preferred style, or the first of `COLOURS` that no listed model has; once all are used, the former."""
        used = [model.style for model in self.listed.values()]
        for style in (preferred, *(PALETTE[name] for name in COLOURS)):
            if style not in used:
                return style
        return preferred

    def _draw(self) -> None:
        visible = [model for number, model in self.listed.items() if number not in self.hidden]
        if not visible:
            self._take_figures({})
            return
        try:
            self._work.start(FIGURES, draw_figures, visible, self.beside, done=self._take_figures, failed=self._failed)
        except ScenarioError:  # something else was quicker
            self._work.when_free(FIGURES, self._draw)
        self._changed()

    def _take_figures(self, figures: dict[str, str]) -> None:
        """Keep figures that were drawn in the background, and show them."""
        self.figures = figures
        self._changed()

    def _failed(self, why: str) -> None:
        self.failure = why
        self._changed()

    def _changed(self) -> None:
        self.revision += 1
        self._tell()

"""Models side by side: identified and drawn in a process of their own, and kept whoever looks at them."""

from collections.abc import Callable
from dataclasses import replace

from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.model_display import IdentifiedModel, draw_figures, identify_request
from scenarios.identification.request import IdentificationRequest
from scenarios.jobs.work import Work
from sysid.plots import PALETTE

IDENTIFICATION, FIGURES = "the identification", "the drawing"
"""Names of the work."""

COLOURS = (*ESTIMATORS, "tfest", "polyest", "welch", "cra")
"""Styles of models; each is used once while there are any."""


class IdentifiedModels:
    """Identified models, each with its colour, and the figures that compare those that are visible.

    Args:
        work: Computes them.
        tell: Called whenever something of this changes.

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
        """What of this is computed now; empty if nothing is."""
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
        """Show the numbers of a model."""
        self.selected = number
        self._changed()

    def remove(self, number: int) -> None:
        """Take a model from the list."""
        self.listed.pop(number, None)
        self.selected = max(self.listed, default=0)
        self.show(hidden=self.hidden - {number}, beside=self.beside)

    def _identified(self, model: IdentifiedModel) -> None:
        used = [one.style for one in self.listed.values()]
        free = [style for style in (model.style, *map(PALETTE.__getitem__, COLOURS)) if style not in used]
        self.selected = self._last = self._last + 1
        self.listed[self._last] = replace(model, name=f"{self._last}: {model.name}", style=[*free, model.style][0])
        self._changed()
        self._work.when_free(FIGURES, self._draw)

    def _draw(self) -> None:
        shown = [one for number, one in self.listed.items() if number not in self.hidden]
        if not shown:
            self._drawn({})
            return
        try:
            self._work.start(FIGURES, draw_figures, shown, self.beside, done=self._drawn, failed=self._failed)
        except ScenarioError:  # something else was quicker
            self._work.when_free(FIGURES, self._draw)
        self._changed()

    def _drawn(self, figures: dict[str, str]) -> None:
        self.figures = figures
        self._changed()

    def _failed(self, why: str) -> None:
        self.failure = why
        self._changed()

    def _changed(self) -> None:
        self.revision += 1
        self._tell()

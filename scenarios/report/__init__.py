"""Pages and figures: the look of figures, figures as files and inside a page, pages from templates."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.report.figures import SETTINGS, Gallery, Picture, save_figure
    from scenarios.report.page import Page

__all__ = ["SETTINGS", "Gallery", "Page", "Picture", "save_figure"]


def __getattr__(name: str) -> object:
    # Matplotlib takes a quarter of a second to load.
    if name not in __all__:
        raise AttributeError(f"module 'scenarios.report' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.report.{'page' if name == 'Page' else 'figures'}"), name)

"""Pages and figures: charts as data and as drawings, figures as files and inside a page, pages from templates."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.report.chart import Chart, Panel, Series
    from scenarios.report.figures import SETTINGS, Picture, picture, save_figure
    from scenarios.report.page import Page

__all__ = ["SETTINGS", "Chart", "Page", "Panel", "Picture", "Series", "picture", "save_figure"]

__getattr__ = lazy_names(__name__, __file__)

"""Figures of the thesis' kinds for anyone's record: spectra, correlations, models, residual tests."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.record_figures.figure_page import write_figure_page
    from scenarios.record_figures.observer_errors import observer_errors
    from scenarios.record_figures.period_spectra import period_spectra
    from scenarios.record_figures.record_figures import RecordFigures, record_figures

__all__ = ["RecordFigures", "observer_errors", "period_spectra", "record_figures", "write_figure_page"]

__getattr__ = lazy_names(__name__, __file__)

"""Report of one identified model: its verdict, values and charts on one page."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.model_report.charts import LabelledChart, model_charts
    from scenarios.model_report.plain_english import Summary, summary
    from scenarios.model_report.report_page import write_model_report

__all__ = ["LabelledChart", "Summary", "model_charts", "summary", "write_model_report"]

__getattr__ = lazy_names(__name__, __file__)

"""Results of estimators side by side: tables and a page."""

__all__: list[str] = []

"""Trials of estimators: each run in a process of its own, measured against the truth, kept."""

__all__: list[str] = []

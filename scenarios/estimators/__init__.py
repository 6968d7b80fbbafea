"""Estimators."""

__all__: list[str] = []

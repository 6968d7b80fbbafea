"""Frequency."""

__all__: list[str] = []

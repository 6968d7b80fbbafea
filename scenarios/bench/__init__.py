"""Bench."""

__all__: list[str] = []

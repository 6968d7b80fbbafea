"""Experiments."""

__all__: list[str] = []

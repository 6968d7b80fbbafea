"""Polynomial."""

__all__: list[str] = []

"""Recursive."""

__all__: list[str] = []

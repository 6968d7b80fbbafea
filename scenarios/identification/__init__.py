"""Identification."""

__all__: list[str] = []

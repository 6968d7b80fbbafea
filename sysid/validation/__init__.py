"""Validation."""

__all__: list[str] = []

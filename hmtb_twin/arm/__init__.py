"""Arm."""

__all__: list[str] = []

"""Hydraulics."""

__all__: list[str] = []

"""Sysid."""

__all__: list[str] = []

"""Subspace."""

__all__: list[str] = []

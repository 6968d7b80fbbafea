"""Run."""

__all__: list[str] = []

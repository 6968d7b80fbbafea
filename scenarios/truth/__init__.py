"""Truth."""

__all__: list[str] = []

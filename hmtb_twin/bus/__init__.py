"""Bus."""

__all__: list[str] = []

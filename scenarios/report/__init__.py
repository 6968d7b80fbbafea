"""Report."""

__all__: list[str] = []

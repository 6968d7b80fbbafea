"""Control."""

__all__: list[str] = []

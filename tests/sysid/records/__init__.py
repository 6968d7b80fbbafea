"""Records."""

__all__: list[str] = []

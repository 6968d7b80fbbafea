"""Jobs."""

__all__: list[str] = []

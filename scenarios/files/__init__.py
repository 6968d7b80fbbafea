"""Files."""

__all__: list[str] = []

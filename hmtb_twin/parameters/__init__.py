"""Parameters."""

__all__: list[str] = []

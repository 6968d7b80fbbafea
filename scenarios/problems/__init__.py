"""Problems."""

__all__: list[str] = []

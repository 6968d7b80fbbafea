"""Whether a data set is whole, says what it must, and can be made again."""

__all__: list[str] = []

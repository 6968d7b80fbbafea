"""A run of the test bench: what it will cost, its trials, its figures, its result."""

__all__: list[str] = []

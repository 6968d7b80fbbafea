"""The figures of the test bench: each its own trials, expectation and verdict."""

__all__: list[str] = []

"""Data sets whose truth is hidden: for classes, with a key to grade by."""

__all__: list[str] = []

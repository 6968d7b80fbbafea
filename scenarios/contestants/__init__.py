"""Estimators that the test bench can call: ours, those of other packages, and some that are wrong on purpose."""

__all__: list[str] = []

"""Predictions and models scored on a data set, and the baselines beside them."""

__all__: list[str] = []

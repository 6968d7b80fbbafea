"""Fits to records that a model has not seen."""

from statistics import median

from scenarios.thesis.comparison import Comparison, ModelResult


def held_out(study: Comparison, model: ModelResult) -> float:
    """Median fit in simulation to the tests that the model has not seen, percent."""
    return median(fit.simulation for fit in model.held_out(study.estimation_test))

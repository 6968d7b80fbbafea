"""Fits to records that a model has not seen."""

from statistics import median

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison, Fit, ModelResult


def held_out(study: Comparison, model: ModelResult) -> float:
    """Median fit in simulation to the tests that the model has not seen, percent.

    Raises:
        MissingRecordError: There is no such test.
    """
    return median(fit.simulation for fit in _fits(study, model))


def held_out_one_step(study: Comparison, model: ModelResult) -> float:
    """The same of the one-step predictions.

    Raises:
        MissingRecordError: There is no such test.
    """
    return median(fit.one_step for fit in _fits(study, model))


def _fits(study: Comparison, model: ModelResult) -> tuple[Fit, ...]:
    found = model.held_out(study.estimation_test)
    if not found:
        raise MissingRecordError(
            f"{model.label} has no test to be judged on: there is none beside test {study.estimation_test} and those "
            "of the same sequence"
        )
    return found

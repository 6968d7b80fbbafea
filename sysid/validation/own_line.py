"""Whether data still have the straight line beside which a model was identified."""

from collections.abc import Sequence

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.model_forms import AnyModel, as_model, chosen_model
from sysid.models.predict import aligned, residuals
from sysid.models.state_space import StateSpace
from sysid.polynomial.fit_with_offset import unexplained_lines
from sysid.records.data import IOData

MATTERS = 0.5
"""Part of the sum of squared one-step errors that a line must explain to be named."""


def has_line(model: Estimate) -> bool:
    """Whether a model was identified beside a straight line in an output; a constant is a line without a slope."""
    return any(map(any, model.diagnostics.get("slopes", ())))


def line_left(model: AnyModel, experiments: Sequence[IOData]) -> str:
    """What to say of a model with a line (`trend=True`) on data that have one too; empty where there is nothing.

    Args:
        model: The model; of others than estimates nobody knows how they were identified.
        experiments: The records.
    """
    estimate = chosen_model(model)
    if not isinstance(estimate, Estimate) or not has_line(estimate):
        return ""
    first = experiments[0]
    own = aligned(as_model(estimate, first), first)
    lines = unexplained_lines(own, experiments)
    without = [experiment.subtract(y=line) for experiment, line in zip(experiments, lines, strict=True)]
    if not _sum_of_squares(own, without) < MATTERS * _sum_of_squares(own, experiments):
        return ""
    return (
        "was identified beside a straight line in the output, which is no part of it, and these data have one: "
        "data.subtract(y=line), or data.detrend(1), removes it first"
    )


def _sum_of_squares(model: StateSpace, experiments: Sequence[IOData]) -> float:
    """Sum of the squared one-step errors of a model behind the initial windows."""
    total = 0.0
    for experiment in experiments:
        total += float(np.nansum(residuals(model, experiment)[experiment.window :] ** 2))
    return total

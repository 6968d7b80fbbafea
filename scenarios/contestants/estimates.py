"""What an estimate of the toolbox says, as an answer on the test bench."""

from dataclasses import replace

import numpy as np

from scenarios.bench_contract.answer import Answer
from scenarios.bench_contract.task import Task
from sysid import Estimate


def answer_of(estimate: Estimate, task: Task, *, noise_model: bool = True) -> Answer:
    """Model, covariance and intervals of an estimate.

    The covariance of a polynomial model's parameters says all of its response; that of a state-space model's, which
    are coordinates of its own, is carried to the response here.

    Args:
        estimate: From any method; a covariance that it does not know (NaN) is not claimed.
        task: What was asked: its frequencies count.
        noise_model: Whether the model of the noise is meant: `iv4` writes one down that it does not believe.

    Returns:
        The answer.
    """
    model = estimate.model if noise_model else replace(estimate.model, K=None, innovation_covariance=None)
    if not np.isfinite(estimate.covariance).all():
        return Answer(model, estimate.polynomials)
    interval = estimate.bandwidth().ci95
    if estimate.polynomials is not None:
        return Answer(model, estimate.polynomials, estimate.covariance, bandwidth_ci95=interval)
    response = estimate.frequency_response(task.frequencies)
    return Answer(model, response_covariance=response.covariance, bandwidth_ci95=interval)

"""What an estimate of the toolbox says, as an answer on the test bench."""

from dataclasses import replace

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.task import Task
from sysid import Estimate


def answer_of(estimate: Estimate, task: Task, *, noise_model: bool = True) -> Answer:
    """Model, covariance and intervals of an estimate.

    Response and bandwidth of a polynomial model are as uncertain as its parameters say, and the bench knows how; the
    parameters of a state-space model are coordinates of its own, so that their covariance is carried through here.

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
    if estimate.polynomials is not None:
        return Answer(model, estimate.polynomials, estimate.covariance)
    response, bandwidth = estimate.response_and_bandwidth(task.frequencies)
    return Answer(model, response_covariance=response.covariance, bandwidth_ci95=bandwidth.ci95)

"""A plant in closed loop, with noise that comes round through the controller."""

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.problems.linear_problem import BURN_IN, Controller, LinearProblem
from scenarios.problems.textbook import binary_sequence
from sysid import Polynomials
from sysid.records.arrays import FloatArray

SAMPLES = 1000
HOLD = 2
GAIN = 0.4
REFERENCE = 1.0
DEVIATION = 0.3
"""Of the innovation, for a reference of +-1: noise is 5 % of the power of the input, and that is enough."""

FEEDBACK = {
    "feedback": "a plant of second order with ARMAX noise under proportional feedback",
    "feedback-arx": "the same with equation noise, of which least squares are unbiased",
}
"""Names, with what they are."""


def feedback(plain: str, name: str, samples: int | None) -> LinearProblem:
    """Input u = r - 0.4 y with a binary r, every bit held for two samples.

    Which estimators are biased: all that take the input as independent of the noise (output error, instruments of the
    input, spectra, open-loop subspace methods), and those whose noise model is wrong. Which are not: prediction-error
    methods in a structure that holds the noise [Ljung1999, sec. 13.4].

    Args:
        plain: One of `FEEDBACK`.
        name: The problem's name.
        samples: Of a record; None: `SAMPLES`.
    """
    c: FloatArray = np.array([1.0, 0.6, 0.3]) if plain == "feedback" else np.ones(1)
    truth = Polynomials(A=np.array([1.0, -1.5, 0.7]), B=np.array([0.0, 1.0, 0.5]), C=c)
    reference = REFERENCE * binary_sequence((samples or SAMPLES) + BURN_IN, HOLD)
    controller = Controller(np.array([GAIN]), np.ones(1))
    return LinearProblem(name, truth, reference[:, None], DEVIATION**2, SAMPLE_TIME, controller)

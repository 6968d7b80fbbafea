"""The printed models of one joint as problems: what the thesis identified, identified again [Morris1996]."""

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.problems.linear_problem import BURN_IN, LinearProblem
from scenarios.problems.textbook import binary_sequence, noise_variance
from scenarios.truth.published import BY_NAME, PublishedModel
from sysid import Polynomials
from sysid.records.arrays import FloatArray

SAMPLES = 4000
HOLD = 5
SIGNAL_TO_NOISE_DB = 20.0
ROUNDING = 1e-9
"""Coefficients below it are zeros after rounding."""
LAST_PLACE = 1e-4
"""The same for C, which is the sum of two printed, rounded numbers."""

PREFIX = "published-"
SINGLE = {PREFIX + name: entry for name, entry in BY_NAME.items() if isinstance(entry, PublishedModel)}
"""All printed models of one joint, by the names of their problems."""


def published_problem(plain: str, name: str, samples: int | None) -> LinearProblem:
    """A printed model driven by the thesis' binary sequence, every bit held for five samples.

    The noise is that of the printed K where there is one, else white at the output; its power is 20 dB below the
    output's. OKID's models have a direct term and no state-space task, which is without.
    """
    entry = SINGLE[plain]
    model = entry.model
    a = np.asarray(np.poly(model.A), dtype=np.float64)
    b = _shown(np.convolve(a, model.markov(model.order + 1)[:, 0, 0])[: model.order + 1])
    a = _shown(a)
    truth = (
        Polynomials(A=a, B=b, C=_shown(entry.noise_polynomial, LAST_PLACE))
        if model.gain.any()
        else Polynomials(B=b, F=a)
    )
    variance = noise_variance(truth, binary_sequence(SAMPLES + BURN_IN, HOLD)[:, None], SIGNAL_TO_NOISE_DB)
    reference = binary_sequence((samples or SAMPLES) + BURN_IN, HOLD)
    return LinearProblem(name, truth, reference[:, None], variance, SAMPLE_TIME)


def _shown(row: FloatArray, least: float = ROUNDING) -> FloatArray:
    """Coefficients with those below `least` set to zero, without zeros behind."""
    clean = np.where(np.abs(row) > least, row, 0.0)
    return clean[: int(np.flatnonzero(clean)[-1]) + 1]

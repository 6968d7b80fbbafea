"""Textbook systems and the thesis' printed models of one joint, driven by binary sequences [Morris1996]."""

from collections.abc import Sequence

import numpy as np

from scenarios.problems.linear_problem import BinaryExcitation, LinearProblem
from scenarios.truth.published import EQUATIONS
from sysid import Polynomials
from sysid.records.arrays import FloatArray


def _system(**rows: Sequence[float]) -> Polynomials:
    return Polynomials(**{name: np.asarray(row, dtype=np.float64) for name, row in rows.items()})


_PLANT = {"B": [0.0, 0.03459, 0.07584], "F": [1.0, -0.9776, 0.07922]}
_LOOP = {"A": [1.0, -1.5, 0.7], "B": [0.0, 1.0, 0.5]}

_P1 = _system(
    A=[1, -2.542, 2.367, -0.8523, -0.08044, 0.1103],
    B=[0, 0, 0.003804, 0.003504, -0.004285],
    C=np.poly([0.5, 0.3 + 0.4j, 0.3 - 0.4j, -0.2, 0.1]).real.tolist(),
)
_P5 = _system(A=np.poly([0.9 * np.exp(0.4j), 0.9 * np.exp(-0.4j), 0.6]).real.tolist(), B=[0, 0, 0.5, -0.2, 0.1])

SYSTEMS = {
    # The published yaw ARMAX model: badly conditioned, single coefficients are hardly known, the response is.
    "p1": (_P1, BinaryExcitation(hold=5, samples=12_000)),
    # The published shoulder-pitch OE model.
    "p2": (_system(**_PLANT), BinaryExcitation(hold=5, samples=12_000)),
    # An ARMAX system of second order with much noise.
    "p3": (
        _system(A=[1, -1.5, 0.7], B=[0, 1.0, 0.5], C=[1, -1.0, 0.2]),
        BinaryExcitation(hold=1, samples=2000, variance=1.0),
    ),
    # The plant of p2 under a resonant disturbance: a Box-Jenkins system.
    "p4": (_system(C=[1, -0.8, 0.2], D=[1, -1.5, 0.7], **_PLANT), BinaryExcitation(hold=5, samples=3000)),
    # An ARX system of third order with a delay of two.
    "p5": (_P5, BinaryExcitation(hold=2, samples=2000)),
}
"""Open-loop systems by name, each with another structure or difficulty, and their excitation."""

_FEEDBACK = BinaryExcitation(hold=2, samples=1000, variance=0.3**2, feedback=0.4)

FEEDBACK = {
    "feedback": (_system(C=[1.0, 0.6, 0.3], **_LOOP), _FEEDBACK),
    # With equation noise, of which least squares are unbiased.
    "feedback-arx": (_system(**_LOOP), _FEEDBACK),
}
"""A plant under proportional feedback, u = r - 0.4 y; the noise is 5 % of the power of the input.

Biased are all that take the input as independent of the noise (output error, instruments of the input, spectra,
open-loop subspace methods), and those whose noise model is wrong; prediction-error methods in a structure that holds
the noise are not [Ljung1999, sec. 13.4].
"""

PREFIX = "published-"
PUBLISHED = {PREFIX + name: equation for name, equation in EQUATIONS.items()}
"""All printed models of one joint, by the names of their problems."""

PUBLISHED_EXCITATION = BinaryExcitation(hold=5, samples=4000)
"""The thesis' binary sequence."""

ROUNDING = 1e-9
"""Coefficients below it are zeros after rounding."""

LAST_PLACE = 1e-4
"""The same for C, which is the sum of two printed, rounded numbers."""


def textbook(plain: str, name: str, samples: int | None) -> LinearProblem:
    """Make a problem of `SYSTEMS`, `FEEDBACK` or `PUBLISHED`.

    The noise of a printed model is that of the printed K where there is one, else white at the output. OKID's models
    have a direct term and no state-space task, which is without.

    Args:
        plain: Name of the system.
        name: Name of the problem.
        samples: Of a record; None for as many as it has.
    """
    if plain in PUBLISHED:
        return PUBLISHED_EXCITATION.problem(name, _published(plain), samples)
    truth, excitation = (SYSTEMS | FEEDBACK)[plain]
    return excitation.problem(name, truth, samples)


def _published(plain: str) -> Polynomials:
    """Polynomials of a printed state-space model."""
    equation = PUBLISHED[plain]
    model = equation.model
    a = np.asarray(np.poly(model.A), dtype=np.float64)
    # B = A times the pulse response, cut behind the order of the system: beyond it the product is zero.
    b = _without_rounding(np.convolve(a, model.markov(model.order + 1)[:, 0, 0])[: model.order + 1], ROUNDING)
    a = _without_rounding(a, ROUNDING)
    if not model.gain.any():
        return Polynomials(B=b, F=a)
    return Polynomials(A=a, B=b, C=_without_rounding(equation.noise_polynomial, LAST_PLACE))


def _without_rounding(row: FloatArray, threshold: float) -> FloatArray:
    """Coefficients with those below the threshold set to zero, without zeros behind."""
    clean = np.where(np.abs(row) > threshold, row, 0.0)
    return clean[: int(np.flatnonzero(clean)[-1]) + 1]

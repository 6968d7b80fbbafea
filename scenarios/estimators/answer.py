"""What an estimator gives back."""

from dataclasses import dataclass

from sysid import Polynomials, StateSpace
from sysid.records.arrays import FloatArray, Locked


@dataclass(frozen=True, eq=False, repr=False)
class Answer(Locked):
    """A model, and what its estimator claims to know of it.

    Attributes:
        model: Innovation form. There is no model of the noise where K is zero and the covariance of the
            innovation is not given, unless polynomials with A = C = D = 1 say that it is white.
        polynomials: A, B, C, D, F, where the method has them.
        covariance: Of their parameters in the sequence A, B, C, D, F (p, p); None: not claimed.
        response_covariance: Of real and imaginary part of the response from input to output at the frequencies of the
            task (nf, ny, nu, 2, 2); None: not claimed. It follows from `covariance` where that is given alone.
        bandwidth_ci95: Ends of the 95 % interval of the half-power bandwidth, (ny, nu) each, Hz; None: not claimed.
    """

    model: StateSpace
    polynomials: Polynomials | None = None
    covariance: FloatArray | None = None
    response_covariance: FloatArray | None = None
    bandwidth_ci95: tuple[FloatArray, FloatArray] | None = None

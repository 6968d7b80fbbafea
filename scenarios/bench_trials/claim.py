"""What an answer claims of its parameters, in the form in which the delta method takes it."""

from dataclasses import dataclass

import numpy as np

from scenarios.bench_contract.answer import Answer
from scenarios.errors import ScenarioError
from sysid import Estimate, IOData, Polynomials
from sysid.arrays import FloatArray
from sysid.estimate import DataSummary
from sysid.orders import Orders
from sysid.polynomial_estimate import Realise


@dataclass(frozen=True, eq=False)
class Claim:
    """Parameters with the covariance that is claimed of them.

    Attributes:
        orders: Layout of the parameters.
        parameters: In the sequence A, B, C, D, F (p,).
        covariance: Of them (p, p).
    """

    orders: Orders
    parameters: FloatArray
    covariance: FloatArray

    def estimate(self, answer: Answer, record: IOData) -> Estimate:
        """As one of our own estimates, which knows the covariance of response and bandwidth.

        Args:
            answer: Whose claim it is.
            record: What it was estimated from.
        """
        data = DataSummary.of([record])
        return Estimate(
            model=answer.model,
            polynomials=answer.polynomials,
            parameters=self.parameters,
            parameter_names=self.orders.names,
            covariance=self.covariance,
            noise_variance=np.full((1, 1), np.nan),
            residuals=np.zeros((0, 1)),
            method="claimed",
            orders={},
            diagnostics={},
            data=data,
            realise=Realise(self.orders, data, 1.0),
        )


def claim_of(answer: Answer) -> Claim | None:
    """The claim of an answer; None where it makes none of its parameters.

    Raises:
        ScenarioError: The covariance does not belong to the polynomials.
    """
    if answer.polynomials is None or answer.covariance is None:
        return None
    orders = layout(answer.polynomials, len(answer.covariance))
    return Claim(orders, parameters_of(answer.polynomials, orders), answer.covariance)


def layout(polynomials: Polynomials, count: int) -> Orders:
    """Orders of polynomials with a number of parameters: all coefficients but leading ones and the delays of B.

    Args:
        polynomials: A, B, C, D, F.
        count: Number of parameters.

    Raises:
        ScenarioError: No delay leaves that many.
    """
    a, c, d = (np.ravel(getattr(polynomials, name)) for name in "ACD")
    b, f = np.atleast_2d(polynomials.B), np.atleast_2d(polynomials.F)
    inputs, most = b.shape
    fixed = len(a) + len(c) + len(d) - 3 + inputs * (f.shape[1] - 1)
    each, rest = divmod(count - fixed, inputs)
    if rest or not 1 <= each <= most:
        expected = " or ".join(str(fixed + inputs * one) for one in range(most, 0, -1))
        raise ScenarioError(
            f"a covariance of {count} parameters given with polynomials A, B, C, D, F of {len(a)}, {most}, {len(c)}, "
            f"{len(d)}, {f.shape[1]} coefficients; expected {expected} parameters: leading ones and delays are none"
        )
    return Orders(
        na=len(a) - 1,
        nb=(each,) * inputs,
        nc=len(c) - 1,
        nd=len(d) - 1,
        nf=(f.shape[1] - 1,) * inputs,
        nk=(most - each,) * inputs,
    )


def parameters_of(polynomials: Polynomials, orders: Orders) -> FloatArray:
    """Parameters in the sequence A, B, C, D, F (p,)."""
    b, f = np.atleast_2d(polynomials.B), np.atleast_2d(polynomials.F)
    return orders.join(polynomials.A, list(b), polynomials.C, polynomials.D, list(f))

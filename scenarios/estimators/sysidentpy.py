"""SysIdentPy: polynomial NARX models, of which those of degree one are linear."""

import warnings

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.refusals import only_delayed, only_one_output, only_structure
from scenarios.estimators.task import Task
from sysid import IOData, Polynomials
from sysid.models import innovations_form

ROUNDS = 60
"""Of extended least squares: more than its 20, with which it has often not settled."""


def arx(data: IOData, task: Task) -> Answer:
    """Least squares; where the orders are open, forward orthogonal regression chooses terms by BIC."""
    only_structure(task, "arx")
    return _fitted(data, task, None)


def armax(data: IOData, task: Task) -> Answer:
    """Extended least squares; its model of the noise is not told, so that none is claimed."""
    only_structure(task, "armax")
    return _fitted(data, task, task.orders.get("nc", task.most_order))


def _fitted(data: IOData, task: Task, nc: int | None) -> Answer:
    only_one_output(data)
    only_delayed(task)
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    n, most = task.orders, task.most_order
    if n:
        of_y = list(range(1, n["na"] + 1))
        of_u = list(range(n["nk"], n["nk"] + n["nb"]))
    else:
        of_y = of_u = list(range(1, most + 1))
    terms = len(of_y) + data.nu * len(of_u) + 1
    search = FROLS(
        ylag=of_y,
        xlag=of_u if data.nu == 1 else [of_u] * data.nu,
        elag=list(range(1, (nc or 1) + 1)),
        order_selection=task.chooses,
        info_criteria="bic",
        # A constant is among the terms: a mean that is none of the dynamics'.
        n_terms=None if task.chooses else terms,
        n_info_values=terms,
        estimator=LeastSquares(unbiased=nc is not None, uiter=ROUNDS),
        basis_function=Polynomial(degree=1),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        search.fit(X=data.u, y=data.y)
    a, b = np.zeros(max(of_y) + 1), np.zeros((data.nu, max(of_u) + 1))
    a[0] = 1.0
    for (code,), value in zip(search.final_model, np.ravel(search.theta), strict=True):
        channel, lag = divmod(int(code), 1000)
        if channel == 1:
            a[lag] = -value
        elif channel:
            b[channel - 2, lag] = value
    polynomials = Polynomials(A=a, B=b if data.nu > 1 else b[0])
    model = innovations_form(polynomials, data.dt)
    if nc is not None:
        model = type(model)(model.A, model.B, model.C, model.D, None, data.dt)
        return Answer(model)
    return Answer(model, polynomials)

"""Output-error models of which a model of the disturbance weights the errors: efficient beside disturbances of colour.

The path of y = B/F u + C/D e is estimated together with C/D, which is then left out: its inverse D/C whitens the output
errors, so that frequencies at which the disturbance is strong count less [Ljung1999, sec. 14.4, 9.3].
"""

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.polynomials import innovations_form
from sysid.models.predict import residuals
from sysid.polynomial.bj import bj
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import make_estimate, prediction_error_estimate
from sysid.polynomial.trends import subtract_lines
from sysid.records.arguments import shown, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each

UNWEIGHTED = (0, 0)
"""Weighting of errors that all count alike."""

AT_THE_EDGE = ("C has a root", "D has a root")
"""Words of the warnings on a model of the disturbance with a root at the unit circle."""

ABOUT_NOISE = (*AT_THE_EDGE, "C and D nearly cancel", "intervals of the noise model")
"""Words of the warnings on a model of the disturbance, which the estimate leaves out."""


def checked_weighting(weighting: object) -> tuple[int, int]:
    """Degrees of C and D of the model of the disturbance that weights the errors.

    Raises:
        SysidError: Anything but two whole numbers, 0 or more.
    """
    if not isinstance(weighting, Sequence) or isinstance(weighting, str) or len(weighting) != 2:
        raise SysidError(
            f"weighting: expected two degrees (nc, nd) of a model C/D of the disturbance, got {shown(weighting)}"
        )
    nc, nd = weighting
    return whole_number("weighting, nc", nc, 0), whole_number("weighting, nd", nd, 0)


def weighted_oe(
    data: IOData | Sequence[IOData], path: Mapping[str, Any], weighting: tuple[int, int], options: Mapping[str, Any]
) -> Estimate:
    """Estimate the path from the input beside a model of the disturbance, and leave that out.

    The covariance of B and F is that beside C and D, which with an input from outside say nothing of them.

    Args:
        data: As `oe` takes them.
        path: The orders nb, nf and nk.
        weighting: Degrees nc and nd of the model of the disturbance.
        options: Options of `bj`.

    Raises:
        SysidError: What `bj` refuses.
    """
    nc, nd = weighting
    with warnings.catch_warnings():
        # repeated below, as far as they are about the path
        warnings.simplefilter("ignore", SysidWarning)
        fit = partial(bj, data, path["nb"], nc, nd, path["nf"], path["nk"])
        whole = fit(**options)
        # sums of squares do not rank fits of Huber's loss
        ranked_by_squares = not options["error_threshold"]
        if options["start"] is None and ranked_by_squares and _is_at_the_edge(whole):
            # There minima stand beside each other: one is also looked for from the path of unweighted errors.
            unweighted = prediction_error_estimate("oe", data, path, coloured=False, **options)
            rival = fit(**{**options, "start": unweighted.polynomials})
            whole = min(whole, rival, key=lambda found: found.diagnostics["sum_of_squares"])
    recorded = as_experiments(data, missing=True)
    orders = make_orders(recorded[0].nu, **path)
    of_path = [k for k, name in enumerate(whole.parameter_names) if name[0] in "bf"]
    theta = whole.parameters[of_path]
    experiments = recorded
    if "offsets" in whole.diagnostics:
        experiments = subtract_lines(recorded, whole.diagnostics["offsets"], whole.diagnostics.get("slopes"))
    block = np.ix_(of_path, of_path)
    diagnostics = {**whole.diagnostics, "weighting": whole.polynomials}
    independent = diagnostics.get("covariance_of_independent_errors")
    if independent is not None:
        diagnostics["covariance_of_independent_errors"] = independent[block]
    from_rest = InitialConditions.of(options["initial_conditions"]) is InitialConditions.ZERO
    messages = [text for text in whole.diagnostics["warnings"] if not any(words in text for words in ABOUT_NOISE)]
    warn_each(messages, stacklevel=3)
    return make_estimate(
        "oe",
        experiments,
        orders,
        orders.select("nb", "nf", "nk"),
        theta=theta,
        covariance=whole.covariance[block],
        variance=_variance(experiments, orders, theta, from_rest=from_rest),
        diagnostics=diagnostics,
        messages=messages,
        at_rest=from_rest,
        recorded=recorded,
        looked_for_offset=True,
        repetition_counted=True,
    )


def _is_at_the_edge(whole: Estimate) -> bool:
    """Whether a root of the model of the disturbance lies at the unit circle."""
    return any(words in text for text in whole.diagnostics["warnings"] for words in AT_THE_EDGE)


def _variance(experiments: Sequence[IOData], orders: Orders, theta: FloatArray, *, from_rest: bool) -> float:
    """Mean square of the output errors, which are not white, unbiased as if they were."""
    model = innovations_form(orders.polynomials(theta), experiments[0].dt)
    initial_state = np.zeros(model.order) if from_rest else None
    errors = np.concatenate([residuals(model, experiment, x0=initial_state)[:, 0] for experiment in experiments])
    known = errors[np.isfinite(errors)]
    states = 0 if from_rest else model.order
    return float(known @ known) / (len(known) - orders.count - states * len(experiments))

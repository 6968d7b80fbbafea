"""Subspace estimates from records with missing outputs: gaps hold what the model before expects in them."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.initial_estimates import interpolated
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning
from sysid.subspace.predictor import Record
from sysid.subspace.predictor_errors import ROUNDS, greatest_likelihood
from sysid.subspace.predictor_estimate import RealiseLocally, make_predictor_estimate

FILLS = 4  # rounds after which the estimate changes by far less than its standard deviation


def estimate_with_gaps(
    fit: Callable[[Sequence[IOData], bool], Estimate], experiments: Sequence[IOData], gain: bool
) -> Estimate:
    """Fit to filled records, fill the gaps by their conditional means under the model, and repeat.

    Args:
        fit: Estimator of complete records, with or without innovation gain; its realisations are `RealiseLocally`.
        experiments: Records, some with missing outputs.
        gain: Whether the last fit has an innovation gain; those before have.
    """
    filled = [replace(e, y=interpolated(e), missing=False) for e in experiments]
    for fill in range(FILLS + 1):
        is_last = fill == FILLS
        with warnings.catch_warnings():
            if not is_last:
                # of records filled provisionally
                warnings.simplefilter("ignore", SysidWarning)
            estimate = fit(filled, gain or not is_last)
        realise = cast(RealiseLocally, estimate.realise)
        predictor, scales = realise.origin, realise.scales
        if not predictor.is_stable():
            raise SysidError("the model without gain is unstable, and cannot fill gaps; gain=True or stable=True can")
        records = [Record.of(e, scales, predictor.has_gain) for e in experiments]
        eliminated, covariance, _ = greatest_likelihood(records, predictor, np.eye(experiments[0].ny), ROUNDS)
        for k, record in enumerate(eliminated):
            # the likelihood begins after the initialisation window, whose outputs stay
            window = filled[k].y[: filled[k].window]
            filled[k] = replace(filled[k], y=np.vstack((window, record.filled.y * scales.y)))
    return make_predictor_estimate(
        estimate.method,
        experiments,
        estimate.orders,
        scales,
        predictor=predictor,
        basis=realise.basis,
        covariance=estimate.covariance,
        diagnostics=estimate.diagnostics,
        messages=estimate.diagnostics["warnings"],
        innovation=covariance,
    )

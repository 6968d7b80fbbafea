"""Covariance of the parameters where an estimator gives none: that of the best unbiased one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.predict import about_operating_point
from sysid.models.repeated_errors import count_repetition_once, inverse_root, whitened_errors
from sysid.records.data import IOData

STEP = 1e-6  # of a central difference, relative to the parameter
LEAST_PARAMETER = 1e-2  # size from which a parameter counts for its step: channels are scaled
SINGULAR = 1e-8  # singular value of the scaled slopes, relative to the largest, of a mere change of the state's basis


def with_least_covariance(estimate: Estimate, experiments: Sequence[IOData]) -> Estimate:
    """The estimate as it is if its covariance is known, else with the Cramer-Rao bound at its parameters [Ljung1999].

    `n4sid` and `pbsid` come near the bound on ordinary records, and never below. Errors that repeat with the input
    count once, as everywhere.

    Args:
        estimate: The estimate.
        experiments: The records of its fit.
    """
    if np.isfinite(estimate.covariance).all() or not np.isfinite(estimate.noise_variance).all():
        return estimate
    experiments = [about_operating_point(estimate, experiment)[0] for experiment in experiments]
    whitening = inverse_root(estimate.noise_variance)
    theta = estimate.parameters
    columns = []
    for k in range(len(theta)):
        step = np.zeros(len(theta))
        step[k] = STEP * max(abs(theta[k]), LEAST_PARAMETER)
        ahead, behind = (
            np.concatenate(
                [errors.ravel() for errors in whitened_errors(estimate.realise(moved), experiments, whitening)]
            )
            for moved in (theta + step, theta - step)
        )
        columns.append((ahead - behind) / (2.0 * step[k]))
    slopes = np.column_stack(columns)
    if not np.isfinite(slopes).all():
        return estimate
    lengths = np.linalg.norm(slopes, axis=0)
    lengths[lengths == 0.0] = 1.0
    inverse = np.linalg.pinv(slopes / lengths, rcond=SINGULAR) / lengths[:, None]
    return count_repetition_once(replace(estimate, covariance=inverse @ inverse.T), experiments)

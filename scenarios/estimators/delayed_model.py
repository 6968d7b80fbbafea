"""A model whose inputs come late."""

import numpy as np

from sysid import StateSpace


def delayed(model: StateSpace, samples: int) -> StateSpace:
    """The model behind a delay of its inputs, a state for each input and sample.

    Args:
        model: Any model.
        samples: 0 or more.
    """
    for _ in range(samples):
        n, nu, ny = model.order, model.nu, model.ny
        A = np.block([[model.A, model.B], [np.zeros((nu, n + nu))]])
        B = np.vstack((np.zeros((n, nu)), np.eye(nu)))
        C = np.hstack((model.C, model.D))
        K = None if model.K is None else np.vstack((model.K, np.zeros((nu, ny))))
        model = StateSpace(A, B, C, np.zeros((ny, nu)), K, model.dt, model.innovation_covariance)
    return model

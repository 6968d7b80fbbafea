"""Local coordinates of state-space predictors: every change of behaviour once, no change of the state's basis."""

from dataclasses import dataclass

import numpy as np

from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import Predictor


@dataclass(frozen=True)
class LocalCoordinates:
    """Directions orthogonal to those that only change the basis of the state [McKelvey2004].

    Attributes:
        direct: Whether D may change.
    """

    direct: bool = True

    def __call__(self, at: Predictor) -> FloatArray:
        """Orthonormal columns (entries of A, M, C, D; q).

        x -> (I + E) x changes A by E A - A E, M by E M, C by -C E: n^2 directions that change no prediction.
        """
        n = len(at.A)
        free = at.A.size + at.M.size + at.C.size
        unit = np.eye(n * n).reshape(n * n, n, n)
        changes = [unit @ at.A - at.A @ unit, unit @ at.M, -at.C @ unit]
        tangent = np.hstack([change.reshape(n * n, -1) for change in changes]).T
        complement = np.linalg.qr(tangent, mode="complete")[0][:, n * n :]
        out = np.zeros((free + at.D.size, complement.shape[1] + (at.D.size if self.direct else 0)))
        out[:free, : complement.shape[1]] = complement
        if self.direct:
            out[free:, complement.shape[1] :] = np.eye(at.D.size)
        return out


@dataclass(frozen=True)
class InputCoordinates:
    """Directions that change B and D alone, in which the prediction is linear.

    Attributes:
        direct: Whether D may change.
    """

    direct: bool = True

    def __call__(self, at: Predictor) -> FloatArray:
        """Columns of zeros and a one each (entries of A, M, C, D; q)."""
        n, nu = len(at.A), at.D.shape[1]
        index = np.arange(at.M.size).reshape(n, -1)[:, :nu].ravel() + at.A.size
        if self.direct:
            index = np.concatenate((index, np.arange(at.D.size) + at.A.size + at.M.size + at.C.size))
        out = np.zeros((at.A.size + at.M.size + at.C.size + at.D.size, len(index)))
        out[index, range(len(index))] = 1.0
        return out

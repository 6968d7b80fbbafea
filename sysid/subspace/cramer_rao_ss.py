"""Cramér-Rao bound of state-space models of given order, in coordinates without the freedom of the basis."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid.models.data_summary import DataSummary
from sysid.models.delta_method import spread
from sysid.models.predict import aligned
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.subspace.predictor import Predictor, Record, Scales, local_coordinates
from sysid.subspace.predictor_errors import Point
from sysid.subspace.predictor_estimate import RealiseLocally
from sysid.subspace.predictor_fit import Normal, linearise
from sysid.validation.cramer_rao import LOG_STEP, CramerRaoBound

DRAWS = 6  # records over which the information is averaged; of 12,000 samples one is within a percent already
FIRST_SEED = 90_000  # of these records


@dataclass(frozen=True, eq=False)
class LocalCoordinates:
    """Local coordinates of state-space models at the truth [McKelvey2004].

    Attributes:
        predictor: Of the truth, channels scaled, in balanced coordinates.
        basis: Directions (entries of A - K C, B and K, C, D; q).
        scales: Of the channels.
        weight: Inverse of the innovation's covariance, scaled (ny, ny).
        realise: From coordinates (q,) to the model; its `parameters` are those of the truth.
    """

    predictor: Predictor
    basis: FloatArray
    scales: Scales
    weight: FloatArray
    realise: RealiseLocally

    @staticmethod
    def at(truth: StateSpace, data: IOData) -> "LocalCoordinates":
        """Coordinates at a truth without direct term, channels scaled by their size in a record.

        Raises:
            SysidError: The truth has no covariance of the innovation, or other channels than the record.
        """
        truth = aligned(truth, data)
        if truth.innovation_covariance is None:
            raise SysidError("a truth without covariance of the innovation given, expected one")
        scales = Scales.of([data])
        predictor = scales.predictor(truth, gain=True).balanced()
        basis = local_coordinates(predictor, direct=False)
        parameters = basis.T @ predictor.vector()
        summary = DataSummary.of([data])
        realise = RealiseLocally(predictor, basis, parameters, scales, summary, truth.innovation_covariance)
        scaled_covariance = truth.innovation_covariance / np.outer(scales.y, scales.y)
        weight = np.asarray(np.linalg.inv(scaled_covariance), dtype=np.float64)
        return LocalCoordinates(predictor, basis, scales, weight, realise)

    def normal(self, data: IOData) -> Normal:
        """Information and score of a record at the truth, the initial state eliminated.

        The score, `gradient`, is the derivative of the logarithm of the likelihood (q,).
        """
        records = [Record.of(data, self.scales, gain=True)]
        point = Point.at(records, self.predictor, self.weight)
        # the covariance of the truth instead of that of this record's errors: the bound is about the truth
        covariance = np.asarray(np.linalg.inv(self.weight), dtype=np.float64)
        at = Point(point.predictor, point.states, point.errors, covariance, point.criterion, spreads=point.spreads)
        return linearise(records, at, self.basis)


def cramer_rao_bound_ss(
    coordinates: LocalCoordinates, draw: Callable[[int], IOData], frequencies: FloatArray
) -> CramerRaoBound:
    """Cramér-Rao bound for Gaussian white innovations, from the information of a few records [Ljung1999, sec. 7.4].

    Args:
        coordinates: Local coordinates at the truth.
        draw: Function from a seed to a record of the truth.
        frequencies: Where the accuracy of the response is wanted (nf,), Hz.

    Returns:
        The bound; its parameters are the local coordinates.
    """
    information = sum(coordinates.normal(draw(FIRST_SEED + k)).information for k in range(DRAWS)) / DRAWS
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    parameters = coordinates.realise.parameters
    truth = coordinates.realise(parameters)
    bandwidths = truth.bandwidth()
    edges = bandwidths[np.isfinite(bandwidths)]
    grid = np.concatenate((frequencies, [0.0], edges))

    def real_and_imaginary(theta: FloatArray) -> FloatArray:
        response = coordinates.realise(theta).frequency_response(grid)
        return np.stack((response.real, response.imag), axis=-1)

    moves = spread(real_and_imaginary, parameters, covariance)
    response = truth.frequency_response(grid)
    count = len(frequencies)
    # of the logarithms of the magnitudes
    relative = ((moves[..., 0] + 1j * moves[..., 1]) / response).real
    deviation = np.full(bandwidths.shape, np.nan)
    for k, (i, j) in enumerate(np.argwhere(np.isfinite(bandwidths))):
        around = edges[k] * np.array([1.0 - LOG_STEP, 1.0 + LOG_STEP])
        ends = truth.frequency_response(around)[:, i, j]
        slope = np.diff(np.log(np.abs(ends)))[0] / (2.0 * LOG_STEP)
        # the crossing follows the gain there relative to that at 0 Hz, as in `Estimate.bandwidth`
        at_dc, at_edge = relative[:, count, i, j], relative[:, count + 1 + k, i, j]
        deviation[i, j] = np.linalg.norm(at_edge - at_dc) / abs(slope)
    return CramerRaoBound(
        polynomials=None,
        parameters=parameters,
        covariance=covariance,
        frequencies=frequencies,
        response=response[:count],
        response_directions=moves[:, :count],
        bandwidth_hz=bandwidths,
        bandwidth_deviation=deviation,
    )

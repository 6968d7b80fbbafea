"""Linear models: state space, polynomials, frequency responses, their uncertainty, prediction and conversion."""

from sysid.models.confidence_bands import band, poles_band, sampled_band, zeros_band
from sysid.models.continuous_estimate import ContinuousEstimate, Modes, damp
from sysid.models.continuous_model import ContinuousModel
from sysid.models.estimate import Bandwidth, Estimate
from sysid.models.forecast import Forecast, forecast
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.predict import predict, residuals, simulate
from sysid.models.reduction import add_delay, hankel_singular_values
from sysid.models.state_space import StateSpace, block_diagonal

__all__ = [
    "Bandwidth",
    "ContinuousEstimate",
    "ContinuousModel",
    "Estimate",
    "Forecast",
    "FrequencyResponse",
    "Modes",
    "Polynomials",
    "StateSpace",
    "add_delay",
    "band",
    "block_diagonal",
    "damp",
    "forecast",
    "hankel_singular_values",
    "innovations_form",
    "poles_band",
    "predict",
    "residuals",
    "sampled_band",
    "simulate",
    "zeros_band",
]

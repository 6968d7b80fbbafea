"""Classical system identification: records, estimators, validation. Knows no robot."""

from sysid.armax import armax
from sysid.arx import arx
from sysid.data import IOData
from sysid.errors import SysidError, SysidWarning
from sysid.estimate import Bandwidth, Estimate
from sysid.excitation import order_of_excitation
from sysid.frequency import FrequencyResponse
from sysid.oe import oe
from sysid.polynomials import Polynomials, innovations_form
from sysid.predict import predict
from sysid.residuals import residuals
from sysid.simulate import simulate
from sysid.state_space import StateSpace, block_diagonal

__all__ = [
    "Bandwidth",
    "Estimate",
    "FrequencyResponse",
    "IOData",
    "Polynomials",
    "StateSpace",
    "SysidError",
    "SysidWarning",
    "armax",
    "arx",
    "block_diagonal",
    "innovations_form",
    "oe",
    "order_of_excitation",
    "predict",
    "residuals",
    "simulate",
]

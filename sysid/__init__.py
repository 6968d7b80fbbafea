"""Classical system identification: records, estimators, validation. Knows no robot."""

from sysid.armax import armax
from sysid.arx import arx
from sysid.compare import ModelFit, compare, fit_percent
from sysid.data import IOData
from sysid.era import Realisation, era
from sysid.era_dc import era_dc
from sysid.errors import SysidError, SysidWarning
from sysid.estimate import Bandwidth, Estimate
from sysid.etfe import etfe
from sysid.excitation import order_of_excitation
from sysid.frequency import FrequencyResponse
from sysid.oe import oe
from sysid.okid import okid
from sysid.polynomials import Polynomials, innovations_form
from sysid.predict import predict
from sysid.resid import ResidualTest, resid
from sysid.residuals import residuals
from sysid.simulate import simulate
from sysid.spa import spa
from sysid.state_space import StateSpace, block_diagonal

__all__ = [
    "Bandwidth",
    "Estimate",
    "FrequencyResponse",
    "IOData",
    "ModelFit",
    "Polynomials",
    "Realisation",
    "ResidualTest",
    "StateSpace",
    "SysidError",
    "SysidWarning",
    "armax",
    "arx",
    "block_diagonal",
    "compare",
    "era",
    "era_dc",
    "etfe",
    "fit_percent",
    "innovations_form",
    "oe",
    "okid",
    "order_of_excitation",
    "predict",
    "resid",
    "residuals",
    "simulate",
    "spa",
]

"""Classical system identification: records, estimators, validation. Knows no robot.

`sysid.plots` draws what they return; it is loaded when it is first used.
"""

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

from sysid.adaptation import Forgetting, Gradient, Kalman
from sysid.armax import armax
from sysid.arx import arx
from sysid.balred import balred, hankel_singular_values
from sysid.bands import Band, RootBand, band, poles_band, sample_models, sampled_band, zeros_band
from sysid.bj import bj
from sysid.bla import BestLinearApproximation, bla
from sysid.compare import ModelFit, compare, fit_percent
from sysid.continuous import c2d, c2d_matched, d2c, d2c_matched
from sysid.covf import CovarianceFunction, covf
from sysid.cra import ImpulseResponse, cra
from sysid.cross_validation import CrossValidation, cross_validate
from sysid.data import IOData
from sysid.delayest import DelayEstimate, delayest
from sysid.era import Realisation, era
from sysid.era_dc import era_dc
from sysid.errors import SysidError, SysidWarning
from sysid.estimate import Bandwidth, Estimate
from sysid.etfe import etfe
from sysid.excitation import order_of_excitation
from sysid.filtering import keep_band, prefilter
from sysid.findstates import findstates
from sysid.frequency import FrequencyResponse
from sysid.identifiability import Cancellation, Identifiability, identifiability
from sysid.importers import read_csv, read_mat, read_netcdf
from sysid.iv4 import iv4
from sysid.n4sid import n4sid
from sysid.oe import oe
from sysid.okid import okid
from sysid.past import Past
from sysid.pem_ss import pem_ss
from sysid.polynomials import Polynomials, innovations_form
from sysid.predict import predict
from sysid.rarmax import rarmax
from sysid.rarx import rarx
from sysid.recursive_estimate import RecursiveEstimate, RecursiveState
from sysid.resample import resample
from sysid.resid import ResidualTest, resid
from sysid.residuals import residuals
from sysid.roe import roe
from sysid.selstruc import selstruc
from sysid.simulate import simulate
from sysid.spa import spa
from sysid.split_delay import split_delay
from sysid.state_space import StateSpace, block_diagonal
from sysid.structure_scan import structure_scan
from sysid.structure_table import StructureTable
from sysid.welch import welch
from sysid.zero_pole_gain import ZeroPoleGain, transfer_function, zero_pole_gain

if TYPE_CHECKING:
    from sysid import plots as plots

__all__ = [
    "Band",
    "Bandwidth",
    "BestLinearApproximation",
    "Cancellation",
    "CovarianceFunction",
    "CrossValidation",
    "DelayEstimate",
    "Estimate",
    "Forgetting",
    "FrequencyResponse",
    "Gradient",
    "IOData",
    "Identifiability",
    "ImpulseResponse",
    "Kalman",
    "ModelFit",
    "Past",
    "Polynomials",
    "Realisation",
    "RecursiveEstimate",
    "RecursiveState",
    "ResidualTest",
    "RootBand",
    "StateSpace",
    "StructureTable",
    "SysidError",
    "SysidWarning",
    "ZeroPoleGain",
    "armax",
    "arx",
    "balred",
    "band",
    "bj",
    "bla",
    "block_diagonal",
    "c2d",
    "c2d_matched",
    "compare",
    "covf",
    "cra",
    "cross_validate",
    "d2c",
    "d2c_matched",
    "delayest",
    "era",
    "era_dc",
    "etfe",
    "findstates",
    "fit_percent",
    "hankel_singular_values",
    "identifiability",
    "innovations_form",
    "iv4",
    "keep_band",
    "n4sid",
    "oe",
    "okid",
    "order_of_excitation",
    "pem_ss",
    "poles_band",
    "predict",
    "prefilter",
    "rarmax",
    "rarx",
    "read_csv",
    "read_mat",
    "read_netcdf",
    "resample",
    "resid",
    "residuals",
    "roe",
    "sample_models",
    "sampled_band",
    "selstruc",
    "simulate",
    "spa",
    "split_delay",
    "structure_scan",
    "transfer_function",
    "welch",
    "zero_pole_gain",
    "zeros_band",
]


def __getattr__(name: str) -> ModuleType:
    """Load `sysid.plots` on first use: an analysis without figures does not wait for what draws them."""
    if name == "plots":
        return importlib.import_module("sysid.plots")
    raise AttributeError(f"module 'sysid' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Names of the package, `plots` among them."""
    return sorted({*globals(), "plots"})

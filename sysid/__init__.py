"""Classical system identification: records, estimators, validation. Knows no robot.

`sysid.plots` draws what they return; it is loaded when it is first used.
"""

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

from sysid.frequency.bla import BestLinearApproximation, bla
from sysid.frequency.covf import CovarianceFunction, covf
from sysid.frequency.cra import ImpulseResponse, cra
from sysid.frequency.delayest import DelayEstimate, delayest
from sysid.frequency.etfe import etfe
from sysid.frequency.spa import spa
from sysid.frequency.welch import welch
from sysid.models.balred import balred, hankel_singular_values
from sysid.models.bands import Band, RootBand, band, poles_band, sample_models, sampled_band, zeros_band
from sysid.models.continuous import c2d, c2d_matched, d2c, d2c_matched
from sysid.models.estimate import Bandwidth, Estimate
from sysid.models.findstates import findstates
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.predict import predict
from sysid.models.residuals import residuals
from sysid.models.simulate import simulate
from sysid.models.split_delay import split_delay
from sysid.models.state_space import StateSpace, block_diagonal
from sysid.models.zero_pole_gain import ZeroPoleGain, transfer_function, zero_pole_gain
from sysid.polynomial.armax import armax
from sysid.polynomial.arx import arx
from sysid.polynomial.bj import bj
from sysid.polynomial.excitation import order_of_excitation
from sysid.polynomial.initial_conditions import Past
from sysid.polynomial.iv4 import iv4
from sysid.polynomial.oe import oe
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.filtering import keep_band, prefilter
from sysid.records.importers import read_csv, read_mat, read_netcdf
from sysid.records.resample import resample
from sysid.recursive.adaptation import Forgetting, Gradient, Kalman
from sysid.recursive.rarmax import rarmax
from sysid.recursive.rarx import rarx
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState
from sysid.recursive.roe import roe
from sysid.subspace.era import Realisation, era
from sysid.subspace.era_dc import era_dc
from sysid.subspace.n4sid import n4sid
from sysid.subspace.okid import okid
from sysid.subspace.pem_ss import pem_ss
from sysid.validation.compare import ModelFit, compare, fit_percent
from sysid.validation.cross_validation import CrossValidation, cross_validate
from sysid.validation.identifiability import Cancellation, Identifiability, identifiability
from sysid.validation.resid import ResidualTest, resid
from sysid.validation.selstruc import selstruc
from sysid.validation.structure_scan import structure_scan
from sysid.validation.structure_table import StructureTable

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

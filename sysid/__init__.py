"""Classical system identification: records, estimators, validation. It knows no robot.

The sub-packages hold the families of methods, with what only experts need. `sysid.plots` draws the records and
estimates; it is loaded on first use.
"""

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

from sysid.continuous import fit_response, fit_response_ss, procest, tfest
from sysid.control import (
    AdaptiveFollowing,
    Controller,
    FollowingDesign,
    VirtualReferenceDesign,
    model_following,
    vrft,
)
from sysid.design import InputDesign, InputSignal, design_input, idinput
from sysid.exchange import read_model, to_fmu, to_matlab, write_model
from sysid.frequency import (
    BestLinearApproximation,
    bla,
    covf,
    cra,
    delayest,
    etfe,
    lpm,
    merge,
    spa,
    spafdr,
    vector_fit,
    welch,
)
from sysid.models import (
    Bandwidth,
    ContinuousEstimate,
    ContinuousModel,
    Estimate,
    Forecast,
    FrequencyResponse,
    Polynomials,
    StateSpace,
    band,
    damp,
    forecast,
    predict,
    residuals,
    simulate,
)
from sysid.models.continuous import c2d, d2c
from sysid.models.predict import findstates
from sysid.models.reduction import balred, split_delay
from sysid.models.zero_pole_gain import transfer_function, zero_pole_gain
from sysid.polynomial import (
    InitialConditions,
    ar,
    arma,
    armax,
    arx,
    bj,
    impulseest,
    iv4,
    ivx,
    oe,
    order_of_excitation,
    polyest,
    two_stage,
)
from sysid.records import (
    IOData,
    SysidError,
    SysidWarning,
    from_dataframe,
    from_xarray,
    keep_band,
    prefilter,
    read_csv,
    read_experiments,
    read_log,
    read_mat,
    read_netcdf,
    read_npz,
    resample,
)
from sysid.records.arrays import register_drawer
from sysid.records.data import register_plotter
from sysid.records.optional import optional
from sysid.recursive import RecursiveEstimate, Track, rarmax, rarx, roe, track
from sysid.selection import StructureChoice, auto
from sysid.subspace import era, era_dc, n4sid, okid, pbsid, pem_ss
from sysid.validation import (
    FeedbackTest,
    ModelError,
    ModelFit,
    ResidualTest,
    compare,
    cross_validate,
    feedback,
    identifiability,
    model_error,
    resid,
    selstruc,
    structure_scan,
)

if TYPE_CHECKING:
    from sysid import plots as plots

__all__ = [
    "AdaptiveFollowing",
    "Bandwidth",
    "BestLinearApproximation",
    "ContinuousEstimate",
    "ContinuousModel",
    "Controller",
    "Estimate",
    "FeedbackTest",
    "FollowingDesign",
    "Forecast",
    "FrequencyResponse",
    "IOData",
    "InitialConditions",
    "InputDesign",
    "InputSignal",
    "ModelError",
    "ModelFit",
    "Polynomials",
    "RecursiveEstimate",
    "ResidualTest",
    "StateSpace",
    "StructureChoice",
    "SysidError",
    "SysidWarning",
    "Track",
    "VirtualReferenceDesign",
    "ar",
    "arma",
    "armax",
    "arx",
    "auto",
    "balred",
    "band",
    "bj",
    "bla",
    "c2d",
    "compare",
    "covf",
    "cra",
    "cross_validate",
    "d2c",
    "damp",
    "delayest",
    "design_input",
    "era",
    "era_dc",
    "etfe",
    "feedback",
    "findstates",
    "fit_response",
    "fit_response_ss",
    "forecast",
    "from_dataframe",
    "from_xarray",
    "identifiability",
    "idinput",
    "impulseest",
    "iv4",
    "ivx",
    "keep_band",
    "lpm",
    "merge",
    "model_error",
    "model_following",
    "n4sid",
    "oe",
    "okid",
    "order_of_excitation",
    "pbsid",
    "pem_ss",
    "polyest",
    "predict",
    "prefilter",
    "procest",
    "rarmax",
    "rarx",
    "read_csv",
    "read_experiments",
    "read_log",
    "read_mat",
    "read_model",
    "read_netcdf",
    "read_npz",
    "resample",
    "resid",
    "residuals",
    "roe",
    "selstruc",
    "simulate",
    "spa",
    "spafdr",
    "split_delay",
    "structure_scan",
    "tfest",
    "to_fmu",
    "to_matlab",
    "track",
    "transfer_function",
    "two_stage",
    "vector_fit",
    "vrft",
    "welch",
    "write_model",
    "zero_pole_gain",
]


def _thumbnail(result: object) -> str:
    from sysid.plots.thumbnail import thumbnail  # loads matplotlib

    return thumbnail(result)


register_drawer(_thumbnail)


def _record_figure(data: object) -> object:
    return __getattr__("plots").record(data)


register_plotter(_record_figure)


class MissingPlotsError(SysidError, AttributeError):
    """What draws figures is not installed: there is no `sysid.plots`."""


def __getattr__(name: str) -> ModuleType:
    """Load `sysid.plots` on first use: an analysis without figures does not wait for what draws them."""
    if name == "plots":
        try:
            with optional("plots"):
                return importlib.import_module("sysid.plots")
        except SysidError as error:
            # `help` and `hasattr` ask for every name, and take no other error for an answer.
            raise MissingPlotsError(str(error)) from error
    raise AttributeError(f"module 'sysid' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Names of the package, `plots` among them."""
    return sorted({*globals(), "plots"})

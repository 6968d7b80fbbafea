"""Small figures inside the HTML of results, as notebooks show them."""

import base64
import io
from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

from sysid.frequency.bla import BestLinearApproximation
from sysid.frequency.covf import CovarianceFunction
from sysid.frequency.cra import ImpulseResponse
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.state_space import StateSpace
from sysid.plots.bode import bode
from sysid.plots.correlations import correlations
from sysid.plots.orders import singular_values, structures
from sysid.plots.recursion import recursion
from sysid.plots.signals import record
from sysid.plots.spectra import spectra
from sysid.plots.transients import impulse
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.recursive.recursive_estimate import RecursiveEstimate
from sysid.subspace.era import Realisation
from sysid.validation.resid import ResidualTest
from sysid.validation.structure_scan import StructureTable

SIZE = (5.0, 3.6)
"""Width and height of a figure, inch."""

MOST = 4
"""Paths of a figure; of a system with more the first one is drawn."""


def thumbnail(result: object) -> str:
    """HTML image of a result; empty where there is no figure of its kind.

    Args:
        result: Any result.
    """
    draw = next((draw for kind, draw in FIGURES.items() if isinstance(result, kind)), None)
    if draw is None:
        return ""
    file = io.BytesIO()
    try:
        draw(result).savefig(file, format="png", dpi=100)
    except SysidError:  # the text beside it says why, as of a response that is nowhere determined
        return ""
    return f'<img alt="figure" src="data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}">'


def _response(result: Any) -> Figure:
    response = result.response if isinstance(result, BestLinearApproximation) else result
    shape = (
        response.response.shape[1:]
        if isinstance(response, FrequencyResponse)
        else getattr(result, "model", result).D.shape
    )
    if not shape[1] and not isinstance(result, StateSpace):
        return spectra(result, size=SIZE)
    few = shape[0] * shape[1] <= MOST
    return bode(result, output=None if few else 0, input=None if few else 0, size=SIZE)


FIGURES: dict[type, Callable[[Any], Figure]] = {
    IOData: lambda data: record(data, size=SIZE),
    Estimate: _response,
    StateSpace: _response,
    FrequencyResponse: _response,
    BestLinearApproximation: _response,
    ImpulseResponse: lambda response: impulse(response, size=SIZE),
    Realisation: lambda realisation: singular_values(realisation, size=SIZE),
    StructureTable: lambda table: structures(table, size=SIZE),
    RecursiveEstimate: lambda estimate: recursion(estimate, size=SIZE),
    ResidualTest: lambda test: correlations(test, size=SIZE),
    CovarianceFunction: lambda covariance: correlations(covariance, size=SIZE),
}
"""Figure of each kind of result."""

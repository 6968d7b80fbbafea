"""Small figures inside the HTML of results, as notebooks show them."""

import base64
import contextlib
import io
import warnings

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

SIZE = (5.0, 3.6)  # width and height of a figure, inch
MOST = 3  # inputs and outputs of a figure; of many the first ones are drawn


def thumbnail(result: object) -> str:
    """HTML image of a result; empty where there is no figure of its kind."""
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # names in scripts that the font lacks
        # no figure of a response that is nowhere determined
        with contextlib.suppress(SysidError):
            if figure := _figure(result):
                figure.savefig(file, format="png", dpi=100)
    if not file.tell():
        return ""
    return f'<img alt="figure" src="data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}">'


def _figure(result: object) -> Figure | None:
    match result:
        case IOData():
            # A time series has no inputs: an empty choice of them would be refused.
            inputs = list(range(min(result.nu, MOST))) or None
            shown = result.select(inputs=inputs, outputs=list(range(min(result.ny, MOST))))
            return record(shown, size=SIZE)
        case Estimate() | FrequencyResponse() | StateSpace() | BestLinearApproximation():
            return _of_response(result)
        case ResidualTest():
            first = None if result.independence_p.size <= MOST else 0
            return correlations(result, output=first, input=first, size=SIZE)
        case CovarianceFunction():
            # n channels take n^2 panels.
            return correlations(result, size=SIZE) if len(result.names) <= MOST else None
        case ImpulseResponse():
            first = None if result.response[0].size <= 2 * MOST else 0
            return impulse(result, output=first, input=first, size=SIZE)
        case Realisation():
            return singular_values(result, size=SIZE)
        case StructureTable():
            return structures(result, size=SIZE)
        case RecursiveEstimate():
            return recursion(result, size=SIZE)
    return None


def _of_response(result: Estimate | FrequencyResponse | StateSpace | BestLinearApproximation) -> Figure | None:
    response = result.response if isinstance(result, BestLinearApproximation) else result
    model = response.model if isinstance(response, Estimate) else response
    ny, nu = model.response.shape[1:] if isinstance(model, FrequencyResponse) else model.D.shape
    if not nu:
        return None if isinstance(response, StateSpace) else spectra(response, size=SIZE)
    first = None if ny * nu <= 2 * MOST else 0
    return bode(result, output=first, input=first, size=SIZE)

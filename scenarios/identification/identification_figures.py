"""What `hmtb identify --out` draws."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

import sysid
from scenarios.identification.identification import Identification
from sysid import FrequencyResponse, SysidError, plots


def figures(found: Identification) -> Mapping[str, Figure]:
    """Figures of a model and of the records behind it.

    Args:
        found: The model.

    Returns:
        Figures by name: `record`, `outputs`, `bode`, `step`, `roots`, and `residuals` where they could be tested.
    """
    model, checked = found.estimate, found.checked
    longest = max(range(len(checked)), key=lambda k: len(checked[k]))
    fit = found.fit.by_experiment[longest] if found.fit.by_experiment else found.fit
    drawn: dict[str, Figure] = {
        "record": plots.record(found.parts),
        "outputs": plots.output_comparison(checked[longest], fit),
        "bode": plots.bode([*_measured(found), model]),
        "step": plots.step(model),
        "roots": plots.pzmap(model),
    }
    if found.test is not None:
        drawn["residuals"] = plots.correlations(found.test, plots.PALETTE.get(model.method, plots.PALETTE["oe"]))
    return drawn


def _measured(found: Identification) -> list[FrequencyResponse]:
    """The response without a model, where the records allow one."""
    try:
        response = sysid.spa(found.parts)
    except SysidError:
        return []
    return [response] if np.isfinite(response.response).any() else []

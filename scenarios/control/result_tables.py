"""Tables of control results: errors, and what the operator sees, without control and with it."""

from collections.abc import Sequence

import numpy as np

from scenarios.control.campaign import IdentifiedPair
from scenarios.control.score import Score
from scenarios.control.study import ControlResult
from scenarios.files.result_table import ResultTable

MRAD = 1e3


def result_tables(scored: Sequence[ControlResult], stressed: Sequence[ControlResult]) -> list[ResultTable]:
    """Errors of all runs, responses that the operator sees where runs show them, and errors of the stress tests.

    Args:
        scored: Results of the scenarios, at least one.
        stressed: Results on changed arms and of designs from wrong models; none without stress tests.
    """
    columns = ["scenario", "method", "without\n/ mrad", "with\n/ mrad", "factor", "at limits\n/ %"]
    columns += ["contact without / with\n/ N", "stable"]
    rows = []
    response_rows = []
    for result in scored:
        scenario = result.runs.scenario
        rows.append([f"{scenario.name}, seed {scenario.seed}", *_error_cells(result)])
        response_rows += _response_rows(result)
    title = "RMS error and factor against the reference model (in brackets: against the simulated reference arm)"
    tables = [ResultTable(title, columns, rows)]
    if response_rows:
        headings = ["scenario", "joint", "gain at 1 Hz", "phase at 1 Hz / °", "bandwidth / Hz"]
        tables.append(ResultTable("What the operator sees: without / with / reference", headings, response_rows))
    if stressed:
        title = f"{stressed[0].runs.scenario.name} with the same laws on other arms, and designs from wrong models"
        rows = [[result.condition, *_error_cells(result)] for result in stressed]
        tables.append(ResultTable(title, ["condition", *columns[1:]], rows))
    return tables


def fit_table(pair: IdentifiedPair) -> ResultTable:
    """How much of each joint the identified models explain in their own records."""
    rows = []
    for name, fit in pair.fits.items():
        rows.append([name, *(f"{value:.3g}" for value in fit)])
    joints = [joint.replace("_", " ") for joint in pair.joints]
    return ResultTable("Fit of the identified models to their own records / %", ["model", *joints], rows)


def beyond_the_arm(scored: Sequence[ControlResult]) -> list[str]:
    """Return a line for each run that is further from the simulated reference arm with control than without."""
    lines = []
    for result in scored:
        if result.controlled is not None and result.factor_arm < 1.0:
            scenario = result.runs.scenario
            lines.append(
                f"{scenario.name}, seed {scenario.seed}: with {result.method} the arm is further from the simulated "
                "reference arm than without control, although nearer to its model"
            )
    return lines


def _error_cells(result: ControlResult) -> list[str]:
    """Method, errors without and with control, their ratio, share at limits, contact forces and stability."""
    without, controlled = result.without, result.controlled
    cells = [result.method, _millirad(without)]
    if controlled is None:
        return [*cells, "failed", "", "", "", ""]
    factor, limited = _factor(result), f"{100 * controlled.limited:.2g}"
    forces = "" if np.isnan(without.force) else f"{without.force:.0f} / {controlled.force:.0f}"
    stable = "yes" if controlled.stable else "NO"
    return [*cells, _millirad(controlled), factor, limited, forces, stable]


def _millirad(score: Score) -> str:
    """Error against the reference model, and against the simulated reference arm where it has run."""
    against_arm = f" ({MRAD * score.total_arm:.3g})" if np.isfinite(score.total_arm) else ""
    return f"{MRAD * score.total:.3g}{against_arm}"


def _factor(result: ControlResult) -> str:
    """Error without control over that with it: against the reference model, and against its simulated arm if it ran."""
    against_arm = f" ({result.factor_arm:.2g})" if np.isfinite(result.factor_arm) else ""
    return f"{result.factor:.2g}{against_arm}"


def _response_rows(result: ControlResult) -> list[list[str]]:
    """Gain and phase at 1 Hz and bandwidth of each joint: without control, with it, and of the reference."""
    if result.controlled is None:
        return []
    reference = result.without.reference_response
    responses = (result.without.response, result.controlled.response, reference)
    rows = []
    for k, joint in enumerate(result.joints):
        if not np.isfinite(reference.gains[1, k]):  # the run did not excite the joint at 1 Hz
            continue
        gains = " / ".join(f"{response.gains[1, k]:.2f}" for response in responses)
        phases = " / ".join(f"{np.degrees(response.phases[1, k]):.0f}" for response in responses)
        bandwidths = " / ".join(f"{response.bandwidth_hz[k]:.2f}" for response in responses)
        cells = [cell.replace("nan", "-") for cell in (gains, phases, bandwidths)]
        rows.append([f"{result.runs.scenario.name}, {result.method}", joint, *cells])
    return rows

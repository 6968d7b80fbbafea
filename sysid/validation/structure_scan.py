"""Choice of orders for any estimator, by fitting every candidate."""

import warnings
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.predict import predict
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.validation.structure_table import Order, StructureTable, make_table


def structure_scan(
    estimator: Callable[..., Estimate],
    data: IOData | Sequence[IOData],
    names: Sequence[str],
    candidates: Iterable[tuple[Order, ...]],
    *,
    validation: IOData | Sequence[IOData] | None = None,
    steps: int | None = 1,
) -> StructureTable:
    """Fit every candidate with a given estimator and rank them; `selstruc` does the same for ARX, and fast.

    `structure_scan(sysid.oe, data, ("nb", "nf", "nk"), itertools.product(range(1, 4), range(1, 4), (1, 2)))`

    Candidates are judged on the same samples: those behind the longest start that any of them needs.

    Args:
        estimator: Called as `estimator(data, *candidate)`; options are fixed by `functools.partial` or a lambda.
        data: One experiment, or several that share the model.
        names: What the orders are called.
        candidates: Orders to try, one tuple each.
        validation: Data to judge on, without their initialisation windows, initial states fitted.
        steps: Prediction horizon for that; None simulates.

    Returns:
        The candidates that could be fitted with all criteria: the best in validation first where it was asked for,
        else the best by BIC. Those that could not stand in `failed`.

    Raises:
        SysidError: No candidate, orders that do not match their names, or none that could be fitted.
    """
    experiments = as_experiments(data)
    others = () if validation is None else as_experiments(validation)
    fits: list[tuple[tuple[Order, ...], Estimate]] = []
    failed = []
    for given in candidates:
        if not isinstance(given, Sequence | tuple):
            raise SysidError(f"expected a tuple of the orders {', '.join(names)} per candidate, got {given!r}")
        candidate = tuple(given)
        if len(candidate) != len(names):
            raise SysidError(f"expected the orders {', '.join(names)}, got {candidate}")
        try:
            with warnings.catch_warnings():
                # of a candidate that is far too large there is much to say; the chosen one says it again
                warnings.simplefilter("ignore", SysidWarning)
                fits.append((candidate, estimator(data, *candidate)))
        except SysidError as error:
            failed.append((candidate, str(error)))
    start = max((estimate.model.order for _, estimate in fits), default=0)
    skipped = [min(max(e.window, start), len(e) - 1) for e in experiments]
    ends = np.cumsum([len(e) for e in experiments])
    rows = sum(len(e) - s for e, s in zip(experiments, skipped, strict=True))
    loss, checked = [], []
    for _, estimate in fits:
        parts = np.split(estimate.residuals, ends[:-1])
        errors = np.concatenate([part[s:] for part, s in zip(parts, skipped, strict=True)])
        covariance = errors.T @ errors / rows
        loss.append(float(max(np.linalg.det(covariance), 0.0)) ** (1.0 / len(covariance)))
        squares = [(e.y - predict(estimate, e, steps=steps))[e.window :] ** 2 for e in others]
        checked.append(float(np.mean(np.concatenate(squares))) if squares else np.nan)
    return make_table(
        tuple(names),
        [candidate for candidate, _ in fits],
        [_parameters(estimate) for _, estimate in fits],
        loss,
        checked,
        samples=rows,
        power=float(np.mean(np.concatenate([e.y for e in experiments]) ** 2)),
        failed=tuple(failed),
    )


def _parameters(estimate: Estimate) -> int:
    """Free parameters: a state-space model in innovation form has n (nu + 2 ny) + nu ny of them."""
    if estimate.polynomials is not None:
        return len(estimate.parameters)
    m = estimate.model
    return m.order * (m.nu + 2 * m.ny) + m.nu * m.ny

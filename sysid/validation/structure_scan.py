"""Tables of candidate orders with their criteria, for any estimator."""

import inspect
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid.models.estimate import Estimate, mean_square
from sysid.models.polynomials import Polynomials
from sysid.models.predict import predict
from sysid.records.arguments import function, shown
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.labelled import Labelled
from sysid.records.printing import LISTED, Part, Table, numbers

Order = int | tuple[int, ...]
Candidate = tuple[Order, ...]
CRITERIA = ("loss", "aic", "aicc", "bic", "fpe", "mdl", "validation")
FLOOR = 1e-20  # loss, relative to the mean square output, below which candidates are equal


@dataclass(frozen=True, eq=False, repr=False)
class StructureTable(Labelled, Locked):
    """Candidate structures with their criteria, the best one first.

    With R the covariance of the one-step errors (ny, ny), p the number of parameters and N that of samples, normal
    innovations have -2 log(likelihood) / N = log det(R) + constant [Ljung1999, sec. 16.4], and

    - aic = log det(R) + 2 p / N,
    - aicc = log det(R) + 2 p / (N - p/ny - (ny + 1)/2) [BedrickTsai1994],
    - bic = log det(R) + p log(N) / N [Schwarz1978].

    In units of the loss V = det(R)^(1/ny), with s = p / (N ny) parameters per output sample, are
    fpe = V (1 + s) / (1 - s) [Akaike1971] and mdl = V (1 + s log(N)) [Rissanen1978].

    Attributes:
        names: Names of the orders.
        orders: One tuple per candidate, in the sequence of `names`.
        parameters: Number of parameters (m,).
        loss: Mean square one-step error on the data of the fit (with several outputs the ny-th root of the
            determinant of its covariance) (m,).
        aic: Akaike's criterion (m,).
        aicc: The same, corrected for short records (m,).
        bic: Schwarz's criterion (m,).
        fpe: Akaike's final prediction error, in units of the loss (m,).
        mdl: Rissanen's minimum description length, in units of the loss (m,).
        validation: Mean square error on validation data (m,); NaN without such data.
        samples: Number of samples N on which every candidate is judged.
        outputs: Number of outputs ny.
        failed: Candidates that could not be fitted, with the reason in words.
    """

    names: tuple[str, ...]
    orders: tuple[Candidate, ...]
    parameters: NDArray[np.int_]
    loss: FloatArray
    aic: FloatArray
    aicc: FloatArray
    bic: FloatArray
    fpe: FloatArray
    mdl: FloatArray
    validation: FloatArray
    samples: int
    outputs: int = field(default=1, kw_only=True)
    failed: tuple[tuple[Candidate, str], ...] = ()

    def __len__(self) -> int:
        """Number of candidates."""
        return len(self.orders)

    def best(self, criterion: FloatArray | str) -> dict[str, Order]:
        """Orders with the smallest value of a criterion, e.g. `table.best("aic")`.

        Args:
            criterion: One of the criteria by name, or a value per candidate (m,).

        Returns:
            Orders by name.

        Raises:
            SysidError: No such criterion, another number of values, or none of them finite.
        """
        if isinstance(criterion, str):
            if criterion not in CRITERIA:
                raise SysidError(f"unknown criterion {criterion!r}, available: {', '.join(CRITERIA)}")
            criterion = getattr(self, criterion)
        values = np.asarray(criterion, dtype=float)
        if values.shape != (len(self),):
            raise SysidError(f"expected one value per candidate, shape ({len(self)},), got {values.shape}")
        if not np.isfinite(values).any():
            raise SysidError("no candidate has a finite value; the validation error needs validation data or folds")
        return dict(zip(self.names, self.orders[int(np.nanargmin(values))], strict=True))

    @property
    def chosen(self) -> dict[str, Order]:
        """Orders of the first candidate: the best in validation if there is one, else by `bic`."""
        return dict(zip(self.names, self.orders[0], strict=True))

    def _parts(self) -> list[Part]:
        arrays, _, _ = self._variables()
        columns = [(name, numbers(values[:LISTED])) for name, (_, values) in arrays.items()]
        chosen = ", ".join(f"{name} {order}" for name, order in self.chosen.items())
        return [f"{min(len(self), LISTED)} of {len(self)} candidates, the best first: {chosen}", Table(columns)]

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        arrays: dict[str, Any] = {}
        for k, name in enumerate(self.names):
            # several orders, of several inputs, have no number
            values = [orders[k] for orders in self.orders]
            arrays[name] = [value if isinstance(value, int) else str(value) for value in values]
        arrays |= {name: getattr(self, name) for name in ("parameters", *CRITERIA)}
        variables = {name: ("candidate", values) for name, values in arrays.items()}
        return variables, {"candidate": range(len(self))}, {"samples": self.samples}


def make_table(
    names: tuple[str, ...],
    orders: list[Candidate],
    parameters: list[int],
    loss: list[float],
    validation: list[float],
    *,
    samples: int,
    power: float,
    outputs: int = 1,
    failed: tuple[tuple[Candidate, str], ...] = (),
) -> StructureTable:
    """Compute the criteria and sort by validation error, else by `bic`; ties go to fewer parameters."""
    if not orders:
        if not failed:
            raise SysidError("expected at least one candidate")
        reasons = "; ".join(f"{candidate}: {reason}" for candidate, reason in failed[:3])
        raise SysidError(f"no candidate could be fitted ({reasons})")
    p = np.array(parameters)
    # below the floor losses are rounding, by which no candidate is better than another
    v = np.maximum(np.array(loss), FLOOR * power)
    checked = np.maximum(np.array(validation), FLOOR * power)
    n, ny = samples, outputs
    # parameters of the regression of each output, and its share of the covariance [BedrickTsai1994]
    per_output, of_covariance = p / ny, 0.5 * (ny + 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        aic = ny * np.log(v) + 2.0 * p / n
        freedom = n - per_output - of_covariance
        correction = 2.0 * p * (per_output + of_covariance) / (n * np.where(freedom > 0.0, freedom, 1.0))
        aicc = np.where(freedom > 0.0, aic + correction, np.inf)
        bic = ny * np.log(v) + p * np.log(n) / n
        fpe = np.where(per_output < n, v * (1 + per_output / n) / np.maximum(1 - per_output / n, 1e-300), np.inf)
        mdl = v * (1 + per_output * np.log(n) / n)
    ranking = checked if np.isfinite(checked).any() else bic
    # an unstable model may have overflowed: it comes last
    sequence = np.lexsort((p, np.where(np.isnan(ranking), np.inf, ranking)))
    return StructureTable(
        names=names,
        orders=tuple(orders[k] for k in sequence),
        parameters=p[sequence],
        loss=v[sequence],
        aic=aic[sequence],
        aicc=aicc[sequence],
        bic=bic[sequence],
        fpe=fpe[sequence],
        mdl=mdl[sequence],
        validation=checked[sequence],
        samples=n,
        outputs=ny,
        failed=failed,
    )


def structure_scan(
    estimator: Callable[..., Estimate],
    data: IOData | Sequence[IOData],
    names: Sequence[str],
    candidates: Iterable[Candidate],
    *,
    validation: IOData | Sequence[IOData] | None = None,
    steps: int | None = 1,
) -> StructureTable:
    """Fit every candidate with an estimator and rank them; `selstruc` does the same faster for ARX.

    `structure_scan(sysid.oe, data, ("nb", "nf", "nk"), itertools.product(range(1, 4), range(1, 4), (1, 2)))`

    Candidates are judged on the same samples, after the longest initial transient of all.

    Args:
        estimator: Called as `estimator(data, nb=1, nf=1, nk=1)`, orders as keywords of these names; options are fixed
            by `functools.partial` or a lambda.
        data: One experiment, or several that share the model.
        names: Names of the orders: parameters of the estimator, in any sequence.
        candidates: Orders to try, one tuple each, in the sequence of `names`.
        validation: Data to judge on, without their initialisation windows, initial states fitted.
        steps: Prediction horizon for that; None simulates.

    Returns:
        The fitted candidates with all criteria, the best in validation first, or by BIC without validation data. The
        others are in `failed`.

    Raises:
        SysidError: No candidate, names that the estimator does not have, orders that do not match their names, or none
            that could be fitted.
    """
    chained = "start" in _checked_signature(estimator, names).parameters
    experiments = as_experiments(data, series=True)
    held_out = () if validation is None else as_experiments(validation, series=True)
    fits, failed = _fit_candidates(estimator, data, names, _checked_candidates(names, candidates), chained=chained)
    transient = max((estimate.model.order for _, estimate in fits), default=0)
    # a sample at least is left of each experiment, however short it is
    skipped = [min(max(e.window, transient), len(e) - 1) for e in experiments]
    output = np.concatenate([e.y for e in experiments])
    return make_table(
        tuple(names),
        [candidate for candidate, _ in fits],
        [parameter_count(estimate) for _, estimate in fits],
        [_loss(estimate, experiments, skipped) for _, estimate in fits],
        [_validation_error(estimate, held_out, steps) for _, estimate in fits],
        samples=len(output) - sum(skipped),
        outputs=experiments[0].ny,
        power=float(np.mean(output**2)),
        failed=tuple(failed),
    )


def _checked_candidates(names: Sequence[str], candidates: Iterable[Candidate]) -> list[Candidate]:
    """Candidates with one order for each name."""
    if not isinstance(candidates, Iterable):
        raise SysidError(f"expected candidates, a tuple of orders each, got {shown(candidates)}")
    checked = []
    for orders in candidates:
        if not isinstance(orders, Sequence) or len(orders) != len(names):
            raise SysidError(f"expected the orders {', '.join(names)} as a tuple per candidate, got {orders!r}")
        checked.append(tuple(orders))
    return checked


def _fit_candidates(
    estimator: Callable[..., Estimate],
    data: IOData | Sequence[IOData],
    names: Sequence[str],
    candidates: list[Candidate],
    *,
    chained: bool,
) -> tuple[list[tuple[Candidate, Estimate]], list[tuple[Candidate, str]]]:
    """Estimates of the candidates, and the reasons of those that failed; `chained` ones start from smaller models."""
    if chained:
        # a stable sort: smaller structures come before those that contain them
        candidates = sorted(candidates, key=_total_order)
    fits: list[tuple[Candidate, Estimate]] = []
    failed = []
    for candidate in candidates:
        options: dict[str, object] = dict(zip(names, candidate, strict=True))
        smaller = [estimate for orders, estimate in fits if chained and _nested(names, orders, candidate)]
        if smaller:
            # the minimum of a smaller structure is a cheap initial estimate that the larger one cannot fit worse
            options["start"] = min(smaller, key=lambda estimate: estimate.loss).polynomials
        try:
            with warnings.catch_warnings():
                # candidates that are too large give many warnings; a later fit of the chosen one repeats its own
                warnings.simplefilter("ignore", SysidWarning)
                fits.append((candidate, estimator(data, **options)))
        except SysidError as error:
            failed.append((candidate, str(error)))
    return fits, failed


def _total_order(candidate: Candidate) -> int:
    """Sum of all orders, of all inputs."""
    return int(np.sum(np.hstack(candidate)))


def _loss(estimate: Estimate, experiments: Sequence[IOData], skipped: Sequence[int]) -> float:
    """Mean square one-step error without the first samples of each experiment."""
    ends = np.cumsum([len(e) for e in experiments])
    by_experiment = np.split(estimate.residuals, ends[:-1])
    counted = [errors[begin:] for errors, begin in zip(by_experiment, skipped, strict=True)]
    return mean_square(np.concatenate(counted))


def _validation_error(estimate: Estimate, held_out: Sequence[IOData], steps: int | None) -> float:
    """Mean square error of a prediction of validation data; NaN without them."""
    if not held_out:
        return float("nan")
    squares = []
    for experiment in held_out:
        errors = experiment.y - predict(estimate, experiment, steps=steps)
        squares.append(errors[experiment.window :] ** 2)
    return float(np.mean(np.concatenate(squares)))


def choose_orders(
    estimator: Callable[..., Estimate],
    data: IOData,
    names: Sequence[str],
    candidates: Sequence[tuple[int, ...]],
    *,
    simulated: bool = False,
    patience: int = 2,
) -> dict[str, Order]:
    """Orders with the least BIC among candidates of rising size, until some in a row are no better than the best.

    Models that are far too large take the longest to fit, and most of them are never needed. Unstable models are
    skipped.

    Args:
        estimator: Called with data and orders as keywords, as `structure_scan` does.
        data: One experiment.
        names: Names of the orders: parameters of the estimator.
        candidates: Orders to try, one tuple each, the smallest first.
        simulated: Whether the error of the simulated output counts instead of that one step ahead: for methods without
            a meaningful noise model.
        patience: Candidates in a row that are tried beyond the best so far.

    Returns:
        Orders by name.

    Raises:
        SysidError: No candidate, names that the estimator does not have, or none that could be fitted.
    """
    chained = "start" in _checked_signature(estimator, names).parameters
    fits: dict[tuple[int, ...], Estimate | SysidError] = {}

    def fit_once(record: IOData, start: Polynomials | None = None, **orders: int) -> Estimate:
        """Estimate of the orders, kept for the scans of more candidates that follow; refuses unstable models."""
        candidate = tuple(orders.values())
        if candidate not in fits:
            run = partial(estimator, start=start) if chained and start is not None else estimator
            try:
                estimate = run(record, **orders)
                stable = estimate.model.input_path().is_stable()
                fits[candidate] = estimate if stable else SysidError(f"orders {candidate} give an unstable model")
            except SysidError as error:
                fits[candidate] = error
        outcome = fits[candidate]
        if isinstance(outcome, SysidError):
            raise outcome
        return outcome

    for count in range(min(patience, len(candidates)), len(candidates) + 1):
        tried = list(candidates[:count])
        if simulated:
            table = structure_scan(fit_once, data, names, tried, validation=data, steps=None)
            # Schwarz's criterion with the error of the simulation in place of that one step ahead
            penalty = table.parameters * np.log(table.samples) / table.samples
            criterion = table.outputs * np.log(table.validation) + penalty
        else:
            table = structure_scan(fit_once, data, names, tried)
            criterion = table.bic
        best = table.best(criterion)
        if tried.index(tuple(best.values())) + patience < count:  # type: ignore[arg-type]
            break
    return best


def _nested(names: Sequence[str], small: Candidate, large: Candidate) -> bool:
    """Whether a structure contains another one with the same delays."""
    # with another delay the first coefficients are others, so nk must agree
    for name, in_small, in_large in zip(names, small, large, strict=True):
        contained = np.equal if name == "nk" else np.less_equal
        if not np.all(contained(in_small, in_large)):
            return False
    return True


def _checked_signature(estimator: Callable[..., Estimate], names: Sequence[str]) -> inspect.Signature:
    """Signature of the estimator; refuses names that are no keywords of it, or that leave out an order."""
    function("estimator", estimator, "such as arx")
    is_list = isinstance(names, Sequence | np.ndarray) and not isinstance(names, str)
    if not is_list or not all(isinstance(name, str) for name in names):
        raise SysidError(f"names: expected the names of orders as texts, such as ('na', 'nb'), got {shown(names)}")
    try:
        signature = inspect.signature(estimator)
    except ValueError as error:
        raise SysidError(f"estimator: {shown(estimator)} has no named parameters, expected one such as arx") from error
    if len(set(names)) != len(names):
        raise SysidError(f"the names of orders must differ, got {', '.join(names)}")
    try:
        signature.bind(None, **dict.fromkeys(names))
    except TypeError as error:
        available = ", ".join(list(signature.parameters)[1:])
        raise SysidError(
            f"the orders are named {', '.join(names)}, the parameters of the estimator {available}: {error}"
        ) from error
    return signature


def parameter_count(estimate: Estimate) -> int:
    """Free parameters: a state-space model in innovation form has n (nu + 2 ny) + nu ny of them."""
    if estimate.polynomials is not None:
        return len(estimate.parameters)
    # of the entries of A, B, C, D and K, n^2 only choose the basis of the state
    m = estimate.model
    # known delays are states without parameters
    order = m.order - sum(estimate.orders.get("nk", ()))
    return order * (m.nu + 2 * m.ny) + m.nu * m.ny

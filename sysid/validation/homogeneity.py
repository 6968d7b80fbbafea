"""Test of homogeneity: do several runs show the same response to the input?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate, as_estimate
from sysid.models.predict import channels_in, output
from sysid.models.recursion import free_response
from sysid.models.state_space import StateSpace
from sysid.polynomial.regressors import lagged
from sysid.records.arguments import confidence_level
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.printing import Part, Table
from sysid.records.singular_values import svd

DETERMINED = 1e-8
"""Eigenvalue of an information matrix, relative to the largest, up to which its direction is not determined."""

COLOUR = 20
"""Largest order of the autoregressive model of a run's disturbance, and samples for each of its coefficients."""

NEGLIGIBLE = 1e-9
"""Deviation of the output from the simulation, relative to the output, that is rounding: runs without noise."""


@dataclass(frozen=True, eq=False, repr=False)
class HomogeneityTest(Locked):
    """Agreement of several runs in their response to the input.

    Attributes:
        runs: Name of each run (K,).
        p_value: Of the hypothesis that all runs have one response; NaN where the test cannot be made.
        statistic: Q of the test with the least p-value.
        freedom: Degrees of freedom of that Q.
        gain_ratios: Gain of each run relative to the model of all runs (K, ny, nu).
        gain_deviations: Their standard deviations (K, ny, nu).
        differences: Root mean square of the change of each run's response from the common one, over that of the
            simulated output, at the inputs of the run (K, ny); chance has part in it.
        p_without: p-values without each run (K,); NaN for two runs, of which none can be left out.
        deviating: Runs without which the others agree, in the sequence in which they were left out.
        level: Confidence level.
        untested: Why the test cannot be made; empty where it can.
    """

    runs: tuple[str, ...]
    p_value: float
    statistic: float
    freedom: int
    gain_ratios: FloatArray
    gain_deviations: FloatArray
    differences: FloatArray
    p_without: FloatArray
    deviating: tuple[str, ...]
    level: float
    untested: str = ""

    @property
    def agree(self) -> bool:
        """Whether the runs agree at the level; true where nothing can be tested."""
        return not self.p_value < 1.0 - self.level

    def _parts(self) -> list[Part]:
        if self.untested:
            return [f"Homogeneity of {len(self.runs)} runs: not tested, {self.untested}"]
        word = "agree" if self.agree else "differ"
        columns = [("run", list(self.runs)), ("p without it", [f"{p:.2g}" for p in self.p_without])]
        for i, j in np.ndindex(self.gain_ratios.shape[1:]):
            ratios = zip(self.gain_ratios[:, i, j], self.gain_deviations[:, i, j], strict=True)
            columns.append(("gain / common gain", [f"{ratio:.4g} ± {deviation:.2g}" for ratio, deviation in ratios]))
        heading = (
            f"Homogeneity of {len(self.runs)} runs at {100 * self.level:g} %: they {word} (p = {self.p_value:.3g})"
        )
        return [heading, Table(columns)]


@dataclass(frozen=True)
class RunRegression:
    """Regression of the deviations of one run from the simulation of the common model, whitened and of unit variance.

    Attributes:
        information: X' X of the changes of the simulation (p, p).
        moment: X' v (p,).
        freedom: Degrees of freedom of the residuals.
        power: X' X before the whitening, over the sum of squares of the simulation (p, p).
    """

    information: FloatArray
    moment: FloatArray
    freedom: int
    power: FloatArray

    def within(self, kept: slice) -> "RunRegression":
        """The regression on some of the changes alone."""
        return RunRegression(self.information[kept, kept], self.moment[kept], self.freedom, self.power[kept, kept])

    def size(self, change: FloatArray) -> float:
        """Root mean square that a change of the parameters gives the output, over that of the simulation."""
        return float(np.sqrt(max(float(change @ self.power @ change), 0.0)))


def homogeneity(estimate: Estimate, data: IOData | Sequence[IOData], *, level: float = 0.99) -> HomogeneityTest:
    """Test whether several runs have one response to the input, and say which of them differs.

    For each run k the change of the parameters from the common model is estimated, b_k = (X_k' X_k)^-1 X_k' v_k: v_k
    is the measured minus the simulated output of the common model, X_k the derivatives of the simulation. Both are
    without initial state and constant, and filtered by the inverse of an autoregressive model of the disturbance of
    their run, so that its colour and size may differ between runs. Changes that are equal up to their covariances give

        Q = sum_k (b_k - b)' X_k' X_k (b_k - b),  b = (sum_k X_k' X_k)^-1 sum_k X_k' X_k b_k,

    the statistic of [Cochran1954] for vectors, compared with the F distribution. Two such tests are made, of all
    parameters and of the gain alone, which has more power where it is the gain that differs; the smaller p-value counts
    twice. With several outputs the smallest counts as often as there are outputs. If the runs differ, the one without
    which the others agree best is left out, again as long as they differ and more than two remain.

    Args:
        estimate: The common model, estimated from all runs.
        data: The runs about their operating points; records of one name, as those before and after a gap, are one run.
        level: Confidence level: runs that agree are told to differ once in 1/(1 - level).

    Returns:
        The test; without `agree`, the model holds for none of the runs, or not for those in `deviating`.

    Raises:
        SysidError: Channels or sampling interval other than the model's, a level outside 0 to 1.
    """
    estimate, level = as_estimate(estimate), confidence_level(level)
    experiments = as_experiments(data, missing=True)
    runs = _runs(experiments)
    channels_in(estimate.model, experiments[0])
    names = tuple(experiments[places[0]].name or f"run {k + 1}" for k, places in enumerate(runs))
    if len(runs) < 2:
        return _untested(estimate, names, level, "there is one run")
    if not estimate.model.input_path().is_stable():
        return _untested(estimate, names, level, "the model is unstable, its simulation means nothing")
    tables = [[_tables(estimate, experiments[k]) for k in places] for places in runs]
    by_output = []
    for i in range(estimate.model.ny):
        by_output.append(_regressions([[table[i] for table in of_run] for of_run in tables]))
    regressions = list(zip(*by_output, strict=True))
    if all(regression is None for of_run in regressions for regression in of_run):
        return _untested(estimate, names, level, "the runs are too short, or the model simulates them exactly")
    p, statistic, freedom = _p_of(regressions, list(range(len(runs))), estimate.model.nu)
    ratios, deviations = _gains(regressions, estimate.model)
    differences = _differences(regressions, estimate.model)
    p_without = _p_without_each(regressions, list(range(len(runs))), estimate.model.nu)
    deviating = _deviating(regressions, estimate.model.nu, 1.0 - level)
    return HomogeneityTest(
        runs=names,
        p_value=p,
        statistic=statistic,
        freedom=freedom,
        gain_ratios=ratios,
        gain_deviations=deviations,
        differences=differences,
        p_without=p_without,
        deviating=tuple(names[k] for k in deviating),
        level=level,
    )


def _runs(experiments: Sequence[IOData]) -> list[list[int]]:
    """Places of the parts of each run: those of one name; without a name each is a run."""
    places: dict[str, list[int]] = {}
    for k, experiment in enumerate(experiments):
        places.setdefault(experiment.name or f"\0{k}", []).append(k)
    return list(places.values())


def _untested(estimate: Estimate, names: tuple[str, ...], level: float, reason: str) -> HomogeneityTest:
    unknown = np.full((len(names), estimate.model.ny, estimate.model.nu), np.nan)
    return HomogeneityTest(
        runs=names,
        p_value=float("nan"),
        statistic=float("nan"),
        freedom=0,
        gain_ratios=unknown,
        gain_deviations=unknown,
        differences=unknown[:, :, 0],
        p_without=np.full(len(names), np.nan),
        deviating=(),
        level=level,
        untested=reason,
    )


@dataclass(frozen=True)
class OutputTable:
    """What one output of a part of a run is regressed on.

    Attributes:
        deviation: Measured minus simulated output, NaN where none is known (N,).
        changes: Of the simulation with the gain of each input and with the parameters (N, nu + p).
        transients: With the initial state and a constant (N, n + 1).
        simulated_power: Sum of squares of the simulated output.
        size: Root mean square of the output.
    """

    deviation: FloatArray
    changes: FloatArray
    transients: FloatArray
    simulated_power: float
    size: float


def _tables(estimate: Estimate, part: IOData) -> list[OutputTable]:
    """Tables of every output of a part."""
    model = estimate.model
    inputs, outputs = channels_in(model, part)
    u, y = np.zeros((len(part), model.nu)), np.zeros((len(part), model.ny))
    u[:, inputs], y[:, outputs] = part.u, part.y

    def simulated(theta: FloatArray) -> FloatArray:
        return _simulated(estimate.realise(theta), u)

    by_parameters = spread(simulated, estimate.parameters, estimate.covariance)
    # without a covariance of the parameters the gains alone are compared
    if not np.isfinite(by_parameters).all():
        by_parameters = np.zeros((0, len(part), model.ny))
    by_gains = np.empty((model.nu, len(part), model.ny))
    for j in range(model.nu):
        single = np.zeros_like(u)
        single[:, j] = u[:, j]
        by_gains[j] = _simulated(model, single)
    path = model.input_path()
    free = np.zeros((len(part), model.ny, path.order))
    died_out = free_response(path.A, path.C, len(part))
    free[: len(died_out)] = died_out
    simulation = by_gains.sum(axis=0)
    deviations = y - simulation
    tables = []
    for i in range(model.ny):
        changes = np.vstack((by_gains[:, :, i], by_parameters[:, :, i])).T
        transients = np.column_stack((free[:, i], np.ones(len(part))))
        size = float(np.sqrt(np.nanmean(y[:, i] ** 2)))
        power = float(np.sum(simulation[:, i] ** 2))
        tables.append(OutputTable(deviations[:, i], changes, transients, power, size))
    return tables


def _simulated(model: StateSpace, u: FloatArray) -> FloatArray:
    """Output (N, ny) from rest, without noise."""
    return output(model, u, np.zeros(model.order))


def _regressions(runs: Sequence[Sequence[OutputTable]]) -> list[RunRegression | None]:
    """Regressions of one output of every run; None for one with too few samples, or that is simulated exactly."""
    disturbances = _disturbances(runs)
    regressions: list[RunRegression | None] = []
    for tables, disturbance in zip(runs, disturbances, strict=True):
        samples = int(np.isfinite(disturbance).sum())
        unknowns = tables[0].changes.shape[1] + len(tables) * tables[0].transients.shape[1]
        size = max(table.size for table in tables)
        if samples < 2 * unknowns or not np.sqrt(np.nanmean(disturbance**2)) > NEGLIGIBLE * size:
            regressions.append(None)
            continue
        whitener = _whitener(disturbance, min(COLOUR, samples // COLOUR))
        regressions.append(_whitened_regression(tables, whitener))
    return regressions


def _whitener(disturbance: FloatArray, most: int) -> FloatArray:
    """Filter 1, a1, ... that makes a disturbance (N,) white, of the order up to `most` that BIC prefers [Schwarz1978].

    By least squares: the Yule-Walker equations flatten the resonances of short records, which made 3 % instead of 1 %
    of agreeing runs with a resonant disturbance seem to differ.
    """
    rows = _known_rows(disturbance, most)
    while most and len(rows) < COLOUR * most:
        # hardly any run of known samples is that long
        most -= 1
        rows = _known_rows(disturbance, most)
    least, whitener = np.inf, np.ones(1)
    for order in range(most + 1):
        coefficients = np.linalg.lstsq(rows[:, :order], rows[:, -1], rcond=None)[0]
        errors = rows[:, -1] - rows[:, :order] @ coefficients
        bic = float(np.log(np.mean(errors**2)) + order * np.log(len(rows)) / len(rows))
        if bic < least:
            least, whitener = bic, np.concatenate(([1.0], -coefficients))
    return whitener


def _known_rows(disturbance: FloatArray, order: int) -> FloatArray:
    """Rows of so many past samples of a disturbance (N,) and the present one, those without NaN."""
    rows = np.column_stack((lagged(disturbance, range(1, order + 1), order), disturbance[order:]))
    return np.asarray(rows[np.isfinite(rows).all(axis=1)])


def _whitened_regression(tables: Sequence[OutputTable], whitener: FloatArray) -> RunRegression | None:
    """Regression of one output of a run, filtered by the whitener of its disturbance."""
    # the first samples of a filtered signal are those of a filter from rest
    first = len(whitener) - 1
    rests, lost = [], first
    for table in tables:
        columns = np.column_stack((table.transients, table.changes, table.deviation))
        rest, count = _without_transients(
            scipy.signal.lfilter(whitener, [1.0], columns, axis=0)[first:], table.transients.shape[1]
        )
        rests.append(rest)
        lost += count
    rows = np.vstack(rests)
    changes, target = rows[:, :-1], rows[:, -1]
    solution, _, rank, _ = np.linalg.lstsq(changes, target, rcond=np.sqrt(DETERMINED))
    freedom = len(target) - lost - int(rank)
    if freedom < 1:
        return None
    errors = target - changes @ solution
    variance = float(errors @ errors) / freedom
    unfiltered = np.vstack([table.changes for table in tables])
    power = unfiltered.T @ unfiltered / max(float(sum(table.simulated_power for table in tables)), np.finfo(float).tiny)
    return RunRegression(changes.T @ changes / variance, changes.T @ target / variance, freedom, power)


def _disturbances(runs: Sequence[Sequence[OutputTable]]) -> list[FloatArray]:
    """Disturbance of every run (N,), NaN where an output is missing: what transients and a common change leave.

    Changes of every run by itself would explain the more of a disturbance, the closer its spectrum is to that of the
    response, and runs that agree would seem to differ.
    """
    rests = []
    for tables in runs:
        for table in tables:
            columns = np.column_stack((table.transients, table.changes, table.deviation))
            rests.append(_without_transients(columns, table.transients.shape[1])[0])
    stacked = np.vstack(rests)
    common = np.linalg.lstsq(stacked[:, :-1], stacked[:, -1], rcond=np.sqrt(DETERMINED))[0]
    errors = iter([rest[:, -1] - rest[:, :-1] @ common for rest in rests])
    disturbances = []
    for tables in runs:
        parts = []
        for table in tables:
            part = np.full(len(table.deviation), np.nan)
            part[np.isfinite(table.deviation)] = next(errors)
            parts.append(part)
        disturbances.append(np.concatenate(parts))
    return disturbances


def _without_transients(columns: FloatArray, count: int) -> tuple[FloatArray, int]:
    """Known rows of columns behind the first `count`, which are transients, without these, and how many these were."""
    known = columns[np.isfinite(columns[:, -1])]
    basis = _basis(known[:, :count])
    return known[:, count:] - basis @ (basis.T @ known[:, count:]), basis.shape[1]


def _basis(columns: FloatArray) -> FloatArray:
    """Orthonormal basis of columns, without directions that rounding determines."""
    scale = np.linalg.norm(columns, axis=0)
    usable = columns[:, scale > 0.0] / scale[scale > 0.0]
    vectors, values, _ = svd(usable, full_matrices=False)
    return np.asarray(vectors[:, values > DETERMINED * values.max(initial=0.0)])


def _p_of(
    regressions: Sequence[Sequence[RunRegression | None]], runs: Sequence[int], nu: int
) -> tuple[float, float, int]:
    """p-value of the agreement of some runs, and Q with its degrees of freedom of the test that gave it."""
    tests = []
    outputs = len(regressions[0])
    for i in range(outputs):
        of_output = [regression for k in runs if (regression := regressions[k][i]) is not None]
        if len(of_output) < 2:
            continue
        parameters = len(of_output[0].moment) - nu
        tests.append(_cochran([regression.within(slice(0, nu)) for regression in of_output]))
        if parameters:
            tests.append(_cochran([regression.within(slice(nu, None)) for regression in of_output]))
    tests = [test for test in tests if np.isfinite(test[0])]
    if not tests:
        return float("nan"), float("nan"), 0
    p, statistic, freedom = min(tests)
    # as many tests, the least p-value of them [Dunn1961]
    return min(1.0, len(tests) * p), statistic, freedom


def _cochran(regressions: Sequence[RunRegression]) -> tuple[float, float, int]:
    """p-value, Q and degrees of freedom of the agreement of runs."""
    separate, rank = 0.0, 0
    for regression in regressions:
        explained, directions = _explained(regression.information, regression.moment)
        separate, rank = separate + explained, rank + directions
    information = np.sum([regression.information for regression in regressions], axis=0)
    moment = np.sum([regression.moment for regression in regressions], axis=0)
    together, common = _explained(information, moment)
    freedom = rank - common
    if freedom < 1:
        return float("nan"), float("nan"), 0
    statistic = max(separate - together, 0.0)
    errors = sum(regression.freedom for regression in regressions)
    return float(scipy.stats.f.sf(statistic / freedom, freedom, errors)), statistic, freedom


def _explained(information: FloatArray, moment: FloatArray) -> tuple[float, int]:
    """Sum of squares m' A^+ m that the changes explain, and the number of directions that are determined."""
    scale = np.sqrt(np.diag(information))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > DETERMINED * values.max(initial=0.0)
    along = vectors[:, kept].T @ (moment / scale)
    return float(np.sum(along**2 / values[kept])), int(kept.sum())


def _gains(regressions: Sequence[Sequence[RunRegression | None]], model: StateSpace) -> tuple[FloatArray, FloatArray]:
    """Gain of every run relative to that of the model, and its deviation (K, ny, nu)."""
    shape = (len(regressions), model.ny, model.nu)
    ratios, deviations = np.full(shape, np.nan), np.full(shape, np.nan)
    for k, by_output in enumerate(regressions):
        for i, regression in enumerate(by_output):
            if regression is None:
                continue
            gains = regression.within(slice(0, model.nu))
            inverse = np.linalg.pinv(gains.information, rcond=DETERMINED, hermitian=True)
            ratios[k, i] = 1.0 + inverse @ gains.moment
            deviations[k, i] = np.sqrt(np.diag(inverse))
    return ratios, deviations


def _differences(regressions: Sequence[Sequence[RunRegression | None]], model: StateSpace) -> FloatArray:
    """Change of the response of every run from the common one, relative to the simulation (K, ny)."""
    differences = np.full((len(regressions), model.ny), np.nan)
    for i in range(model.ny):
        of_output = {
            k: regression for k, by_output in enumerate(regressions) if (regression := by_output[i]) is not None
        }
        if not of_output:
            continue
        # without parameters in it, the changes of the gains
        compared = slice(model.nu, None) if len(next(iter(of_output.values())).moment) > model.nu else slice(None)
        kept = {k: regression.within(compared) for k, regression in of_output.items()}
        information = np.sum([regression.information for regression in kept.values()], axis=0)
        common = _change(information, np.sum([regression.moment for regression in kept.values()], axis=0))
        for k, regression in kept.items():
            differences[k, i] = regression.size(_change(regression.information, regression.moment) - common)
    return differences


def _change(information: FloatArray, moment: FloatArray) -> FloatArray:
    """Estimated changes A^+ m (p,)."""
    return np.asarray(np.linalg.pinv(information, rcond=DETERMINED, hermitian=True) @ moment)


def _p_without_each(regressions: Sequence[Sequence[RunRegression | None]], runs: Sequence[int], nu: int) -> FloatArray:
    """p-values of the agreement of the others, without each of the runs."""
    if len(runs) < 3:
        return np.full(len(runs), np.nan)
    return np.array([_p_of(regressions, [k for k in runs if k != left_out], nu)[0] for left_out in runs])


def _deviating(regressions: Sequence[Sequence[RunRegression | None]], nu: int, least_p: float) -> list[int]:
    """Runs to leave out so that the others agree; none where they agree, or where no majority does."""
    kept, left_out = list(range(len(regressions))), list[int]()
    while _p_of(regressions, kept, nu)[0] < least_p:
        if len(kept) <= len(regressions) // 2 + 1:
            return []
        p_without = _p_without_each(regressions, kept, nu)
        worst = kept[int(np.nanargmax(p_without))] if np.isfinite(p_without).any() else kept[0]
        kept.remove(worst)
        left_out.append(worst)
    return left_out

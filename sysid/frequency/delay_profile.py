"""Profile of the likelihood over the delay of one input, with models of low order: which delays the data allow."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import scipy

from sysid.models.polynomials import stabilised
from sysid.polynomial.correlation import autoregression
from sysid.polynomial.error_jacobian import error_jacobian
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.initial_estimates import check_room_to_start, oe_initial_estimates
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import Linearisation, linearise, minimise
from sysid.polynomial.trends import OFFSET, level
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

MOST_POLES = 5  # of the models; more lags look like a delay
PATIENCE = 2  # orders in a row that are tried beyond the best
STARTS = 1  # initial estimates of each order
FIRST_STEPS = 30  # of the search at the first delay of an order
STEPS = 10  # of the search at every other delay, from the answer at its neighbour
FAR = 50.0  # BIC above the best from which on delays further away are not fitted
ADDED = 0.5  # pole, of 1/sample, that a smaller model gets on the way to a larger one
COLOUR = 10  # highest order of the autoregressive model of the disturbance
LONGEST = 10_000  # samples of all experiments that the models are fitted to
EARLY = 0.5  # share of the input's movement, by its squared steps, from which on it is lost with the first samples
EXACT = 1e-20  # mean square error, relative to that of the output, that is rounding
LIMIT = 1.0 - 1e-6  # radius at which roots of starts are kept


@dataclass(frozen=True, eq=False)
class DelayProfile:
    """How well models with each delay explain an output.

    Attributes:
        criterion: Least BIC of the models with each delay, above that of the best of all (largest + 1,).
        deviance: -2 log likelihood with Akaike's penalty for poles, above that of the best model (largest + 1,): a
            delay is allowed where a model with more poles needs it.
        poles: Poles of that model (largest + 1,).
        needed: Whether the input explains anything.
        exact: Whether the best model leaves but rounding.
    """

    criterion: FloatArray
    deviance: FloatArray
    poles: np.ndarray
    needed: bool
    exact: bool

    @property
    def delay(self) -> int:
        """Delay of the best model; -1 if the input explains nothing."""
        return int(np.argmin(self.criterion)) if self.needed else -1

    def interval(self, level: float) -> tuple[int, int]:
        """Least and largest delay that the likelihood does not reject at a level."""
        if not self.needed:
            return -1, -1
        allowed = self.deviance <= scipy.stats.chi2.ppf(level, 1)
        allowed[self.delay] = True
        (delays,) = np.nonzero(allowed)
        return int(delays[0]), int(delays[-1])


def delay_profile(experiments: Sequence[IOData], largest: int) -> DelayProfile:
    """Profile over the delays 0..largest of one input, from models B(q)/F(q) of low orders fitted at each of them.

    The disturbance is white, or of an autoregressive model that the errors of a model of any delay select. Of the
    models with one delay the one of least BIC counts [Schwarz1978]: a model without a delay that imitates one by more
    poles pays for them.

    Args:
        experiments: Complete records with one input and one output.
        largest: Largest delay.

    Raises:
        SysidError: Too little data.
    """
    records = _prepared(experiments, largest)
    records = _whitened(records, largest)
    search = ProfileSearch(records, largest)
    for poles in range(MOST_POLES + 1):
        search.try_poles(poles)
        if poles - search.best_poles() >= PATIENCE:
            break
    return search.profile()


def _prepared(experiments: Sequence[IOData], largest: int) -> tuple[IOData, ...]:
    """Parts of the records whose errors count at any delay.

    Inputs that move in the first samples above all, as in a step test, are taken as held at their first values before.
    """
    margin = largest + MOST_POLES + 1
    kept = LONGEST // len(experiments) + margin
    records = []
    for experiment in experiments:
        record = experiment[:kept]
        steps = np.diff(record.u[:, 0]) ** 2
        if np.sum(steps[:margin]) >= EARLY * np.sum(steps):
            u = np.concatenate((np.full((margin, 1), record.u[0]), record.u))
            y = np.concatenate((np.full((margin, 1), record.y[0]), record.y))
            records.append(replace(record, u=u, y=y, window=margin + record.window))
        elif len(record) > 2 * margin:
            records.append(replace(record, window=max(record.window, margin)))
    if not records:
        raise SysidError(f"too little data: {2 * margin} samples at least, to compare delays up to {largest}")
    return tuple(records)


def _whitened(records: tuple[IOData, ...], largest: int) -> tuple[IOData, ...]:
    """The records filtered so that the disturbance becomes white; its colour is that of a model with all delays."""
    orders = Orders(0, (largest + MOST_POLES,), 0, 0, (MOST_POLES - 1,), (0,), OFFSET)
    counted = sum(len(e) - e.window for e in records)
    if counted < 4 * orders.count:
        # so few samples show no colour beside so many parameters
        return records
    start = next(oe_initial_estimates(_levelled(records), orders))
    minimum = minimise(records, orders, start.theta, max_iterations=STEPS)
    errors = []
    for e in records:
        errors.append(error_jacobian(e, orders, minimum.at.theta, InitialConditions.ESTIMATED).columns[:, -1])
    joined = np.concatenate(errors)
    power = float(np.concatenate([e.y for e in records]).var())
    if float(joined @ joined) <= EXACT * power * len(joined):
        return records
    whitener, _ = autoregression(joined - joined.mean(), min(COLOUR, counted // 20), select=True)
    lost = len(whitener) - 1
    if not lost:
        return records
    filtered = []
    for e in records:
        u, y = scipy.signal.lfilter(whitener, [1.0], np.hstack((e.u, e.y)) - np.hstack((e.u[0], e.y[0])), axis=0).T
        filtered.append(replace(e, u=u, y=y, window=e.window + lost))
    return tuple(filtered)


def _levelled(records: tuple[IOData, ...]) -> tuple[IOData, ...]:
    """The records without offsets, which initial estimates do not know."""
    return level(records, OFFSET).experiments


@dataclass(frozen=True, eq=False)
class DelayScan:
    """Models with one denominator at every delay.

    Attributes:
        denominator: F (nf + 1,).
        costs: Sums of squared errors by delay.
        numerators: Coefficients of B that fit best by delay.
    """

    denominator: FloatArray
    costs: FloatArray
    numerators: list[FloatArray]

    def start(self, nk: int) -> tuple[Orders, FloatArray]:
        """Orders and parameters at a delay."""
        numerator = self.numerators[nk]
        orders = Orders(0, (len(numerator),), 0, 0, (len(self.denominator) - 1,), (nk,), OFFSET)
        b = np.concatenate((np.zeros(nk), numerator))
        return orders, orders.join(np.ones(1), [b], f=[self.denominator])


def _lowest_minima(costs: FloatArray) -> list[int]:
    """Delays of the two lowest local minima, the ends included."""
    padded = np.concatenate(([np.inf], costs, [np.inf]))
    minima = np.flatnonzero((costs <= padded[:-2]) & (costs <= padded[2:]))
    return [int(nk) for nk in minima[np.argsort(costs[minima])][:2]]


class ProfileSearch:
    """Models of rising orders at every delay.

    Attributes:
        records: Records with one input and one output, the disturbance white.
        largest: Largest delay.
        criteria: BIC of the best model by poles and delay.
    """

    def __init__(self, records: tuple[IOData, ...], largest: int) -> None:
        self.records, self.largest = records, largest
        self.samples = sum(len(e) - e.window for e in records)
        y = [e.y[e.window :, 0] for e in records]
        self.power = float(np.mean(np.concatenate([signal - signal.mean() for signal in y]) ** 2))
        self.criteria: dict[tuple[int, int], float] = {}
        self.deviances: dict[int, float] = {}
        self._reference = np.inf
        self._levelled = _levelled(records)
        self._denominator: dict[int, FloatArray] = {}

    def criterion(self, at: Linearisation) -> float:
        """BIC of a fit; offsets and initial states are the same number for all of one order."""
        loss = max(at.cost / at.errors, EXACT * self.power)
        return float(at.errors * np.log(loss) + (len(at.theta) + at.transients) * np.log(at.errors))

    def deviance(self, at: Linearisation, poles: int, nb: int) -> float:
        """-2 log likelihood with two for each parameter of the poles: BIC would reject a truth that has more of them.

        A further first coefficient, which any shorter delay has for nothing, pays as in BIC.
        """
        loss = max(at.cost / at.errors, EXACT * self.power)
        further = nb - max(poles, 1)
        return float(at.errors * np.log(loss) + 4.0 * poles + further * np.log(at.errors))

    def without_input(self) -> float:
        """BIC of a constant alone, one for each experiment."""
        count = len(self.records)
        return float(self.samples * np.log(self.power) + count * np.log(self.samples))

    def best_poles(self) -> int:
        """Poles of the best model so far."""
        poles, _ = min(self.criteria, key=self.criteria.__getitem__)
        return poles

    def try_poles(self, poles: int) -> None:
        """Fit models with as many poles, B with as many coefficients or one more, near the delays that suit them."""
        fits: dict[tuple[int, int], Linearisation] = {}
        for f in self._denominators(poles):
            scan = self._scan(f, max(poles, 1))
            for nk in _lowest_minima(scan.costs):
                self._improve(fits, scan.start(nk), FIRST_STEPS)
        if not fits:
            return
        nb, best = min(fits, key=lambda key: fits[key].cost)
        if poles:
            # a delay that is no whole number of samples has one coefficient more
            *_, (f,) = self._orders(poles, nb, best).split(fits[nb, best].theta)
            scan = self._scan(f, nb + 1)
            for nk in _lowest_minima(scan.costs):
                self._improve(fits, scan.start(nk), FIRST_STEPS)
        self._spread(fits)

    def _spread(self, fits: dict[tuple[int, int], Linearisation]) -> None:
        """Fit the neighbours of the best delay, from its denominator, as far as the likelihood may allow them."""
        for nb in {key[0] for key in fits}:
            best = min((key for key in fits if key[0] == nb), key=lambda key: fits[key].cost)
            for step in (1, -1):
                key = best
                while True:
                    *_, (f,) = self._orders(len(fits[key].theta) - nb, *key).split(fits[key].theta)
                    nk = key[1] + step
                    if not 0 <= nk <= self.largest:
                        break
                    self._improve(fits, self._scan(f, nb).start(nk), STEPS)
                    key = nb, nk
                    if self.criterion(fits[key]) > min(self.criteria.values()) + FAR:
                        break

    def _denominators(self, poles: int) -> Iterator[FloatArray]:
        """Denominators of models with as many poles, from some delays and from the best smaller model."""
        if not poles:
            yield np.ones(1)
            return
        for nk in self._first_delays():
            orders = self._orders(poles, poles, nk)
            with suppress(SysidError):
                check_room_to_start(self._levelled, orders)
                for estimate in islice(oe_initial_estimates(self._levelled, orders), STARTS):
                    *_, (f,) = orders.split(estimate.theta)
                    if np.isfinite(f).all():
                        yield stabilised(f, LIMIT)
        if poles - 1 in self._denominator:
            # a pole in the middle of the band, which changes little
            yield np.convolve(self._denominator[poles - 1], [1.0, -ADDED])

    def _first_delays(self) -> list[int]:
        """Delays at which an order begins: the shortest, the middle, and the best of the orders before."""
        delays = {0, self.largest // 2}
        if self.criteria:
            delays.add(min(self.criteria, key=self.criteria.__getitem__)[1])
        return sorted(delays)

    def _orders(self, poles: int, nb: int, nk: int) -> Orders:
        return Orders(0, (nb,), 0, 0, (poles,), (nk,), OFFSET)

    def _scan(self, f: FloatArray, nb: int) -> "DelayScan":
        """Costs at every delay with a fixed denominator: the errors are linear in B, and one table holds all lags."""
        poles = len(f) - 1
        all_lags = self._orders(poles, nb + self.largest, 0)
        at = linearise(self.records, all_lags, all_lags.join(np.ones(1), [np.zeros(nb + self.largest)], f=[f]))
        columns = at.triangle[:, : nb + self.largest]
        unexplained = at.cost - float(at.target @ at.target)
        costs, numerators = [], []
        for nk in range(self.largest + 1):
            lags = slice(nk, nk + nb)
            b, *_ = np.linalg.lstsq(columns[:, lags], -at.target, rcond=1e-12)
            costs.append(unexplained + float(np.sum((at.target + columns[:, lags] @ b) ** 2)))
            numerators.append(b / at.scale[lags])
        return DelayScan(f, np.array(costs), numerators)

    def _improve(
        self, fits: dict[tuple[int, int], Linearisation], start: tuple[Orders, FloatArray], steps: int
    ) -> None:
        """Search from a start, and keep what is lower than the fit of the same structure."""
        orders, theta = start
        (nb,), (nk,), (poles,) = orders.nb, orders.nk, orders.nf
        at = minimise(self.records, orders, theta, max_iterations=steps).at
        if (nb, nk) in fits and fits[nb, nk].cost <= at.cost:
            return
        fits[nb, nk] = at
        criterion = self.criterion(at)
        if criterion < min((value for (n, _), value in self.criteria.items() if n == poles), default=np.inf):
            *_, (self._denominator[poles],) = orders.split(at.theta)
        self.criteria[poles, nk] = min(self.criteria.get((poles, nk), np.inf), criterion)
        deviance = self.deviance(at, poles, nb)
        self.deviances[nk] = min(self.deviances.get(nk, np.inf), deviance)
        if criterion <= min(self.criteria.values()):
            self._reference = deviance

    def profile(self) -> DelayProfile:
        """The best models by delay."""
        criterion = np.full(self.largest + 1, np.inf)
        poles = np.zeros(self.largest + 1, dtype=int)
        for (order, nk), value in self.criteria.items():
            if value < criterion[nk]:
                criterion[nk], poles[nk] = value, order
        deviance = np.full(self.largest + 1, np.inf)
        for nk, value in self.deviances.items():
            deviance[nk] = value
        best = float(criterion.min())
        rounding = self.samples * np.log(EXACT * self.power)
        exact = best <= rounding + 4 * MOST_POLES * np.log(self.samples)
        return DelayProfile(
            criterion - best, deviance - self._reference, poles, best < self.without_input(), bool(exact)
        )

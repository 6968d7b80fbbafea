"""Profile of the likelihood over the delay of one input, with models of low order: which delays the data allow."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
import scipy

from sysid.models.polynomials import stabilised
from sysid.polynomial.correlation import autoregression
from sysid.polynomial.error_jacobian import error_jacobian
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.initial_estimates import check_room_to_start, oe_initial_estimates
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import Linearisation, LinearModel, linearise, minimise
from sysid.polynomial.stability_limit import outward
from sysid.polynomial.trends import OFFSET, level
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

MOST_POLES = 5  # of the models; more lags look like a delay
PATIENCE = 2  # orders in a row that are tried beyond the best
TRIED = 3  # delays of each order from which the search begins
FEW_STEPS = 5  # of the search from each of them
FIRST_STEPS = 30  # of the search at the first delay of an order
STEPS = 10  # of the search at every other delay, from the answer at its neighbour
SETTLED = 0.02  # of the criterion, at which a search ends
FAR = 15.0  # -2 log likelihood above the best from which on delays further away are not fitted
HOPELESS = 60.0  # -2 log likelihood above another delay that the linear model of a start promises, not to search there
DEPENDENT = 1e-12  # singular value of regressors, relative to the largest, that rounding makes of zero
ADDED = 0.5  # pole, of 1/sample, that a smaller model gets on the way to a larger one
COLOUR = 10  # highest order of the autoregressive model of the disturbance
LONGEST = 10_000  # samples of all experiments that the models are fitted to
EARLY = 0.5  # share of the input's movement, by its squared steps, from which on it is lost with the first samples
PRICE = 2.0  # in -2 log likelihood, of a pole with its coefficient of B
NOTHING = 0.05  # bound on a response, relative to its peak, that counts as none
RESPONSE = 200  # samples of a response in which its peak lies
LEAST_POWER = 1e-250  # mean square of an output
EXACT = 1e-20  # mean square error, relative to that of the output, that is rounding
LIMIT = 1.0 - 1e-6  # radius at which roots of starts are kept

Structure = tuple[int, int, int]
"""Poles, coefficients of B, and delay."""


@dataclass(frozen=True)
class DelayProfile:
    """Delays that models of low order allow.

    Attributes:
        delay: That of the model of least BIC; -1 if the input explains nothing.
        interval: Least and largest delay that the likelihood does not reject; -1 if the input explains nothing.
        poles: Most poles of the models with these two delays that it does not reject.
        variance: Mean square of the one-step errors of the model of least BIC.
        samples: Number of these errors.
    """

    delay: int
    interval: tuple[int, int]
    poles: tuple[int, int]
    variance: float
    samples: int


def delay_profile(experiments: Sequence[IOData], largest: int, level: float) -> DelayProfile:
    """Delay of one input between 0 and a largest one, from models B(q)/F(q) of low orders fitted at each of them.

    The disturbance is white, or of an autoregressive model that the errors of a model of any delay select. Of the
    models with one delay the one of least BIC counts [Schwarz1978]: a model without a delay that imitates one by more
    poles pays for them.

    Args:
        experiments: Complete records with one input and one output.
        largest: Largest delay.
        level: Confidence level of the interval.

    Raises:
        SysidError: Too little data.
    """
    records = _prepared(experiments, largest)
    records = _whitened(records, largest)
    search = ProfileSearch(records, largest, level)
    shortest = min(len(e) - max(e.window, largest + MOST_POLES + 1) for e in records)
    for poles in range(MOST_POLES + 1):
        if poles > max(shortest, 1):
            # the free initial state of an experiment would fit all of it
            break
        search.try_poles(poles)
        if poles - search.best_poles() >= PATIENCE:
            break
    search.spread()
    return search.profile()


def _prepared(experiments: Sequence[IOData], largest: int) -> tuple[IOData, ...]:
    """Parts of the records whose errors count at any delay.

    Inputs that move in the first samples above all, as in a step test, are taken as held at their first values before.
    """
    margin = largest + MOST_POLES + 1
    kept = LONGEST // len(experiments) + margin
    records = []
    for experiment in experiments:
        record = liveliest_stretch(experiment, kept, margin)
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


def liveliest_stretch(experiment: IOData, length: int, margin: int) -> IOData:
    """The stretch of so many samples in which the input moves most, with a margin ahead of it where there is one."""
    if len(experiment) <= length:
        return experiment
    movement = np.concatenate(([0.0], np.cumsum(np.diff(experiment.u[:, 0]) ** 2)))
    last = len(experiment) - length
    starts = np.append(np.arange(0, last, length // 2), last)
    start = int(starts[np.argmax(movement[starts + length - 1] - movement[starts])])
    return experiment[max(start - margin, 0) : start + length]


def _whitened(records: tuple[IOData, ...], largest: int) -> tuple[IOData, ...]:
    """The records filtered so that the disturbance becomes white; its colour is that of a model with all delays."""
    orders = Orders(0, (largest + MOST_POLES,), 0, 0, (MOST_POLES - 1,), (0,), OFFSET)
    counted = sum(len(e) - e.window for e in records)
    if counted < 4 * orders.count:
        # so few samples show no colour beside so many parameters
        return records
    start = next(oe_initial_estimates(_levelled(records), orders))
    minimum = minimise(records, orders, start.theta, max_iterations=STEPS, tolerance=1.0 / counted)
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


def _orders(poles: int, nb: int, nk: int) -> Orders:
    """Orders of an output-error model with an offset."""
    return Orders(0, (nb,), 0, 0, (poles,), (nk,), OFFSET)


def _denominator(theta: FloatArray, poles: int) -> FloatArray:
    """F of parameters, whose coefficients come last (poles + 1,)."""
    return np.concatenate(([1.0], theta[len(theta) - poles :]))


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
        fits: Models by structure, in their sequence.
    """

    def __init__(self, records: tuple[IOData, ...], largest: int, level: float) -> None:
        self.records, self.largest = records, largest
        self.errors = sum(len(e) - e.window for e in records)
        y = [e.y[e.window :, 0] for e in records]
        power = float(np.mean(np.concatenate([signal - signal.mean() for signal in y]) ** 2))
        # the squares of an output that is rounding alone vanish, and have no logarithm
        self.power = max(power, LEAST_POWER)
        # of -2 log likelihood, above the best
        self._rejection = float(scipy.stats.chi2.ppf(level, 1))
        self.fits: dict[Structure, Linearisation] = {}
        # criterion and structure of the best fit
        self._lowest: tuple[float, Structure] = (np.inf, (0, 1, 0))
        self._levelled = _levelled(records)

    def criterion(self, at: Linearisation) -> float:
        """BIC of a fit; offsets and initial states are the same number for all of one order."""
        loss = max(at.cost / at.errors, EXACT * self.power)
        return float(at.errors * np.log(loss) + (len(at.theta) + at.transients) * np.log(at.errors))

    def deviance(self, key: Structure) -> float:
        """-2 log likelihood with a price of poles below that of BIC, which rejects a truth that has more of them.

        A further coefficient of B, which any shorter delay has for nothing, pays as in BIC.
        """
        at = self.fits[key]
        loss = max(at.cost / at.errors, EXACT * self.power)
        return float(at.errors * np.log(loss)) + self._price(key)

    def _price(self, key: Structure) -> float:
        """What the parameters of a structure cost in its deviance."""
        poles, nb, _ = key
        further = nb - max(poles, 1)
        return float(PRICE * poles + further * np.log(self.errors))

    def without_input(self) -> float:
        """BIC of a constant alone, one for each experiment."""
        count = len(self.records)
        return float(self.errors * np.log(self.power) + count * np.log(self.errors))

    def best_poles(self) -> int:
        """Poles of the best model so far."""
        return self._lowest[1][0]

    def try_poles(self, poles: int) -> None:
        """Fit models with as many poles, B with as many coefficients or one more, near the delays that suit them."""
        self._search(self._denominators(poles), poles, max(poles, 1))
        searched = [at for (count, _, _), at in self.fits.items() if count == poles]
        if poles and searched:
            # a delay that is no whole number of samples has one coefficient more
            best = min(searched, key=lambda at: at.cost)
            self._search([_denominator(best.theta, poles)], poles, poles + 1)

    def _search(self, denominators: Iterable[FloatArray], poles: int, nb: int) -> None:
        """Search from the delays that suit some denominators best, a few steps from each, then to the minimum."""
        starts: dict[int, tuple[float, FloatArray]] = {}
        for f in denominators:
            costs, numerators = self._scan(f, nb)
            for nk in _lowest_minima(costs):
                if nk not in starts or costs[nk] < starts[nk][0]:
                    starts[nk] = costs[nk], np.concatenate((numerators[nk], f[1:]))
        best_first = sorted(starts, key=lambda nk: starts[nk][0])[:TRIED]
        lowest = np.inf
        for nk in best_first:
            key = poles, nb, nk
            start = self._promising(key, starts[nk][1], lowest)
            if start is not None:
                self._improve(key, start, FEW_STEPS)
                lowest = min(lowest, self.fits[key].cost)
        searched = [key for key in self.fits if key[:2] == (poles, nb)]
        if best_first and searched:
            key = min(searched, key=lambda key: self.fits[key].cost)
            self._improve(key, self.fits[key].theta, FIRST_STEPS)

    def _promising(self, key: Structure, theta: FloatArray, lowest: float) -> Linearisation | None:
        """Prediction errors at a start; None if their linear model predicts a far higher cost than at another delay."""
        orders = _orders(*key)
        at = linearise(self.records, orders, theta)
        longest = max(map(len, self.records))
        _, decrease = LinearModel.at(at, partial(outward, orders, samples=longest)).step(0.0)
        if at.cost - decrease > lowest * np.exp(HOPELESS / self.errors):
            return None
        return at

    def spread(self) -> None:
        """Fit the neighbours of the best delay of every structure, as far as the likelihood may allow them."""
        best_of_structure: dict[tuple[int, int], Structure] = {}
        for key in self.fits:
            best = best_of_structure.get(key[:2])
            if best is None or self.fits[key].cost < self.fits[best].cost:
                best_of_structure[key[:2]] = key
        for best in sorted(best_of_structure.values(), key=lambda key: self.criterion(self.fits[key])):
            for step in (1, -1):
                self._walk(best, step)

    def _walk(self, best: Structure, step: int) -> None:
        """Fit neighbour after neighbour in one direction, each from the denominator of the one before."""
        poles, nb, nk = best
        end = self.largest if step > 0 else 0
        while nk != end and self._is_near((poles, nb, nk)) and not self._is_allowed(end):
            f = _denominator(self.fits[poles, nb, nk].theta, poles)
            nk += step
            key = poles, nb, nk
            self._improve(key, self._with_denominator(f, nb, nk), STEPS, self._allowed_cost(key))

    def _allowed_cost(self, key: Structure) -> float:
        """Cost of a structure at which it is in the interval: no lower one says more."""
        left = self.deviance(self._lowest[1]) + self._rejection - self._price(key)
        return float(self.errors * np.exp(left / self.errors))

    def _is_allowed(self, nk: int) -> bool:
        """Whether some model with a delay is in the interval already, beyond which nothing is left to try."""
        limit = self.deviance(self._lowest[1]) + self._rejection
        return any(key[2] == nk and self.deviance(key) <= limit for key in self.fits)

    def _is_near(self, key: Structure) -> bool:
        """Whether the likelihood of a fit is not so low that its neighbours need not be looked at."""
        return self.deviance(key) <= self.deviance(self._lowest[1]) + FAR

    def _denominators(self, poles: int) -> Iterator[FloatArray]:
        """Denominators of models with as many poles, from some delays and from the best smaller model."""
        if not poles:
            yield np.ones(1)
            return
        for nk in self._first_delays():
            orders = _orders(poles, poles, nk)
            with suppress(SysidError):
                check_room_to_start(self._levelled, orders)
                for estimate in islice(oe_initial_estimates(self._levelled, orders), 1):
                    *_, (f,) = orders.split(estimate.theta)
                    if np.isfinite(f).all():
                        yield stabilised(f, LIMIT)
        smaller = [key for key in self.fits if key[0] == poles - 1]
        if smaller:
            best = min(smaller, key=lambda key: self.criterion(self.fits[key]))
            # a pole in the middle of the band, which changes little
            yield np.convolve(_denominator(self.fits[best].theta, poles - 1), [1.0, -ADDED])

    def _first_delays(self) -> list[int]:
        """Delays at which an order begins: the shortest, the middle, and the best of the orders before."""
        delays = {0, self.largest // 2}
        if self.fits:
            delays.add(self._lowest[1][2])
        return sorted(delays)

    def _scan(self, f: FloatArray, nb: int) -> tuple[FloatArray, list[FloatArray]]:
        """Costs by delay with a fixed denominator, and the B that fit best: one table of regressors has all lags."""
        count = nb + self.largest
        at = self._linear(f, count, 0)
        unexplained = at.cost - float(at.target @ at.target)
        costs, numerators = [], []
        for nk in range(self.largest + 1):
            lags = slice(nk, nk + nb)
            columns = at.triangle[:, lags]
            b, *_ = np.linalg.lstsq(columns, -at.target, rcond=DEPENDENT)
            costs.append(unexplained + float(np.sum((at.target + columns @ b) ** 2)))
            numerators.append(b / at.scale[lags])
        return np.array(costs), numerators

    def _with_denominator(self, f: FloatArray, nb: int, nk: int) -> FloatArray:
        """Parameters with a fixed denominator at one delay, the B that fits best."""
        at = self._linear(f, nb, nk)
        b, *_ = np.linalg.lstsq(at.triangle[:, :nb], -at.target, rcond=DEPENDENT)
        return np.concatenate((b / at.scale[:nb], f[1:]))

    def _linear(self, f: FloatArray, nb: int, nk: int) -> Linearisation:
        """The errors as a function of B alone, at B = 0."""
        return linearise(self.records, _orders(len(f) - 1, nb, nk), np.concatenate((np.zeros(nb), f[1:])))

    def _improve(self, key: Structure, start: FloatArray | Linearisation, steps: int, good_enough: float = 0.0) -> None:
        """Search from a start to a cost that is good enough, and keep what is lower than the fit of this structure."""
        at = minimise(
            self.records,
            _orders(*key),
            start,
            max_iterations=steps,
            good_enough=good_enough,
            tolerance=SETTLED / self.errors,
        ).at
        if key in self.fits and self.fits[key].cost <= at.cost:
            return
        self.fits[key] = at
        # without noise models with a leading zero are as good: the longest delay counts
        self._lowest = min(self._lowest, (self.criterion(at), key), key=lambda fit: (fit[0], -fit[1][2]))

    def profile(self) -> DelayProfile:
        """The best delay, and those that the likelihood does not reject."""
        criterion, best = self._lowest
        if criterion >= self.without_input():
            return DelayProfile(-1, (-1, -1), (0, 0), self.power, self.errors)
        delay = best[2]
        poles_by_delay = {delay: best[0]}
        limit = self.deviance(best) + self._rejection
        for key in self.fits:
            poles, _, nk = key
            if self.deviance(key) <= limit and not self._begins_with_nothing(key, delay):
                poles_by_delay[nk] = max(poles, poles_by_delay.get(nk, 0))
        shortest, longest = min(poles_by_delay), max(poles_by_delay)
        return DelayProfile(
            delay=delay,
            interval=(shortest, longest),
            poles=(poles_by_delay[shortest], poles_by_delay[longest]),
            variance=self.fits[best].cost / self.errors,
            samples=self.errors,
        )

    def _begins_with_nothing(self, key: Structure, delay: int) -> bool:
        """Whether a model with a shorter delay than the best shows that no response comes before that one.

        It holds the best model then, as any with further coefficients does, and is no rival of it.
        """
        poles, nb, nk = key
        ahead = delay - nk
        if ahead <= 0:
            return False
        at = self.fits[key]
        impulse = np.zeros(ahead + RESPONSE)
        impulse[0] = 1.0
        f = _denominator(at.theta, poles)
        response = scipy.signal.lfilter(at.theta[:nb], f, impulse)
        by_b = scipy.signal.lfilter([1.0], f, impulse)[:ahead]
        by_f = -scipy.signal.lfilter([1.0], f, response)[:ahead]
        # h changes by the impulse response of 1/F per coefficient of B, by that of -B/F^2 per coefficient of F
        slopes = [_delayed(by_b, lag) for lag in range(nb)]
        slopes += [_delayed(by_f, lag) for lag in range(1, poles + 1)]
        half = np.linalg.pinv(at.triangle) / at.scale[:, None] * np.sqrt(at.cost / at.errors)
        deviations = np.linalg.norm(np.stack(slopes, axis=1) @ half, axis=1)
        bound = np.abs(response[:ahead]) + 2.0 * deviations
        return bool(np.all(bound <= NOTHING * np.abs(response).max()))


def _delayed(signal: FloatArray, lag: int) -> FloatArray:
    """A signal of the same length that begins later."""
    return np.concatenate((np.zeros(min(lag, len(signal))), signal[: max(len(signal) - lag, 0)]))

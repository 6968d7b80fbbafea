"""Choice of the structure of continuous-time models: poles, zeros, delay, and the factors of process models."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sysid.continuous import procest, tfest
from sysid.continuous.initial_estimates import QUICK, initial_estimates
from sysid.continuous.output_error import LONGEST_DELAY, hides_delay, longest_delay
from sysid.continuous.output_error_criterion import TIGHT, OutputError
from sysid.continuous.output_error_search import moves_early, quick_minimum
from sysid.continuous.path_response import TransferFunction
from sysid.continuous.structures import PathStructure, ProcessPath, RationalPath, RealisePaths, enlarged
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.models.continuous_model import ContinuousModel
from sysid.models.data_summary import DataSummary
from sysid.polynomial.correlation import colour, relative_spectrum
from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.polynomial_estimate import COLOUR, directions
from sysid.polynomial.prediction_error import Minimum, coloured_information
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError
from sysid.selection.auto import StructureChoice, stretches
from sysid.selection.loop import Loop
from sysid.selection.slow_modes import slow_radius
from sysid.selection.structure_search import FAR, HARDLY_TOLD, SLOW, Candidate, largest_ratio

WORSE = 2
"""Numbers of poles in a row without a better criterion, after which no larger one is tried."""

STEPS = 10
"""Steps of the search of a candidate, at most: the chosen one is refined to the end."""

REFINED = 40
"""Steps of the search of the chosen model on all data, at most."""

LONGEST = 4_000
"""Samples on which candidates are compared."""

SCREENED = 1_500
"""Samples of longer records on which each search begins; all compared samples end it."""

UNFINISHED = 0.05
"""Decrease of -2 log likelihood below which the search of a candidate ends: it is too small to change the choice."""

ROUNDING = 1e-9
"""Errors, relative to the deviation of the output, that count as none."""

OVERDAMPED = 0.9
"""Damping from which on a pair of poles may as well be real."""

INTEGRATES = 0.1
"""Time constant, relative to the longest record, from which on an integrator may be in its place."""

FASTEST = 2.0 * np.pi
"""Modulus of a pole, times the sampling interval, from which on samples do not show it: that of the sampling rate."""

HARDLY_SMALLER = 0.1
"""Deviation of the errors, relative, by which poles faster than samples show must fall to suggest still more poles."""

UNFIT = 1e9
"""What stands above the criterion of a candidate that follows a disturbance, so that it comes last."""

SIMPLER = 1.0
"""BIC by which a candidate must be better than a simpler one: rounding and unfinished searches differ by less."""


def choose_tfest(
    data: IOData | Sequence[IOData], *, offset: bool = False, largest: int = 5, longest: int = LONGEST
) -> StructureChoice:
    """Choose the numbers of poles and zeros of `tfest`, and whether there is a delay.

    The number of poles rises, with one zero less and an estimated delay, until the criterion is worse twice. Then the
    two best lose zeros, and the delay. Where the output depends on the input of the same sample, which no controller
    computes from it, models with as many zeros as poles come too.

    The criterion is the BIC [Schwarz1978] of output errors of any colour: of their values whitened by an
    autoregressive model, whose coefficients count as parameters, as do initial states and constants.

    Args:
        data: One experiment, or several that share the model, with one output; of several inputs all paths have the
            same structure.
        offset: Whether the output of every experiment has an unknown constant, as in `tfest`.
        largest: Largest number of poles.
        longest: Samples on which candidates are compared; the chosen model is of all.

    Returns:
        The model with the orders poles, zeros and delay ("estimated", or 0 for none), and the other candidates.

    Raises:
        SysidError: Several outputs, or no candidate can be fitted.

    Warns:
        SysidWarning: What `tfest` says about the chosen model.
    """
    largest = whole_number("largest", largest, 1)
    search = _CandidateSearch.of("tfest", data, offset, longest)
    worse = 0
    for poles in range(1, largest + 1):
        least = search.least
        search.fit(RationalPath(poles, poles - 1, None))
        worse = 0 if search.least < least else worse + 1
        if worse == WORSE or search.ends_in_fast_poles():
            break
    for structure in search.best_structures(2, within=FAR):
        fewer = range(structure.zeros - 1, -1, -1)
        fewer_zeros = [RationalPath(structure.poles, zeros, None) for zeros in fewer]
        search.fit_while_better(fewer_zeros, search.bic_of(structure) + FAR)
    (best,) = search.best_structures(1)
    search.fit(RationalPath(best.poles, best.zeros, 0.0))
    if Loop.of(search.all_data, direct=False).is_direct:
        # as many zeros as poles: a direct term, which has no delay
        search.fit_while_better([RationalPath(poles, poles, 0.0) for poles in range(1, largest + 1)], np.inf)
    return search.choice(
        lambda chosen, theta: tfest(
            search.all_data,
            chosen.poles,
            chosen.zeros,
            delay=chosen.delay,
            offset=search.offset,
            start=theta,
            max_iterations=REFINED,
        )
    )


def choose_procest(data: IOData | Sequence[IOData], *, offset: bool = False, longest: int = LONGEST) -> StructureChoice:
    """Choose the kind of process model of `procest`, by the criterion of `choose_tfest`.

    Kinds of up to three poles with a delay come first, with an integrator where the slowest of them lasts a tenth of
    the record; then the best with a zero, with a pole more or less, without delay, or with real in place of complex
    poles, as long as that helps. A zero beside a single pole is a direct term: beside feedback it is not tried.

    Args:
        data: One experiment, or several that share the model, with one output; of several inputs all paths have the
            same kind. Kinds with an integrator are fitted to the signals as they were before an operating point was
            removed: without the mean of its input an integrator has a ramp, and a constant is part of its state.
        offset: Whether the output of every experiment has an unknown constant, as in `procest`.
        longest: Samples on which candidates are compared; the chosen model is of all.

    Returns:
        The model with its kind, and the other candidates.

    Raises:
        SysidError: Several outputs, or no candidate can be fitted.

    Warns:
        SysidWarning: What `procest` says about the chosen model.
    """
    search = _CandidateSearch.of("procest", data, offset, longest)
    search.fit_each(map(ProcessPath, ("P0", "P1D", "P2DU", "P3DU")))
    if search.slowest > INTEGRATES * max(len(e) * e.dt for e in search.compared):
        search.fit_each(map(ProcessPath, ("P0DI", "P1DI", "P2DIU")))
    direct = Loop.of(search.all_data, direct=False).allows_direct_term
    tried = None
    while tried != search.best_structures(1):
        tried = search.best_structures(1)
        kind = search.best_candidate.orders["kind"]
        search.fit_each(map(ProcessPath, _variants(str(kind), search.damping, direct=direct)))

    def estimate(chosen: PathStructure, theta: FloatArray) -> ContinuousEstimate:
        with_offset = search.offset and not chosen.integrators
        kind = str(search.best_candidate.orders["kind"])
        return procest(search.data_of(chosen), kind, offset=with_offset, start=theta, max_iterations=REFINED)

    return search.choice(estimate)


def _reshaped(structure: PathStructure, path: TransferFunction, dt: float) -> FloatArray:
    """Parameters of a structure that is near a transfer function with more or fewer poles, zeros and delay."""
    delay = path.delay if structure.delay is None else structure.delay
    b: FloatArray = path.b[: structure.zeros + 1]
    a: FloatArray = path.a
    if len(a) - 1 > structure.poles:
        # the fastest poles go: their effect is the shortest
        roots = sorted(np.roots(a[::-1]), key=abs)[: structure.poles]
        shorter = np.asarray(np.poly(roots).real[::-1], dtype=np.float64)
        scale = shorter[structure.integrators] / a[structure.integrators]
        b, a = b * scale, shorter
    return enlarged(structure, TransferFunction(b, a, delay), dt)


def _drive(criterion: OutputError, minimum: Minimum, half: FloatArray, tables: Sequence[FloatArray]) -> float:
    """Least evidence that the input drives the slow modes of a candidate, as `slow_modes.least_drive` has it."""
    at, dt = minimum.at, criterion.experiments[0].dt
    radius = slow_radius(max(map(len, criterion.experiments)))
    whitener, correlations = colour(np.concatenate([table[:, -1] for table in tables]))
    least, begin = np.inf, 0
    for structure, values in zip(criterion.structures, criterion.split(at.theta), strict=True):
        transfer, end = structure.transfer(values), begin + len(values)
        # over the leading coefficient of the denominator: of a very slow lag gain and time constant alone are vague
        leading, jacobian = transfer.a[-1], structure.jacobian(values)
        numerator = transfer.b / leading
        by_leading = jacobian[structure.zeros + 1 + structure.poles]
        by_numerator = (jacobian[: structure.zeros + 1] - np.outer(numerator, by_leading)) / leading
        covariance = half[begin:end] @ half[begin:end].T * at.cost / at.errors
        begin = end
        for pole in np.roots(transfer.a[structure.integrators :][::-1]):
            if abs(np.exp(pole * dt)) <= radius or pole.imag < 0.0:
                continue
            powers = pole ** np.arange(structure.zeros + 1)
            rows = np.array([powers.real, powers.imag] if pole.imag else [powers.real])
            value, slopes = rows @ numerator, rows @ by_numerator
            spread = slopes @ covariance @ slopes.T * relative_spectrum(whitener, correlations, float(pole.imag * dt))
            statistic = float(value @ np.linalg.pinv(spread, hermitian=True) @ value) / len(value)
            least = min(least, statistic)
    return least


def _samples_before(criterion: OutputError) -> int:
    """Samples ahead of a part of a record that no error of it counts in."""
    return round(criterion.longest / criterion.experiments[0].dt)


def liveliest_parts(experiments: Sequence[IOData], length: int, margin: int) -> Sequence[IOData]:
    """For each input the part of so many samples in which it moves most, with a margin ahead of it.

    The experiments themselves where they have hardly more samples.
    """
    if sum(map(len, experiments)) <= 1.5 * length:
        return experiments
    share = length // experiments[0].nu
    begins = {_liveliest_part(experiments, j, share): None for j in range(experiments[0].nu)}
    parts = []
    for k, begin in begins:
        parts.append(experiments[k][max(begin - margin, 0) : begin + share])
    return tuple(parts)


def _liveliest_part(experiments: Sequence[IOData], j: int, length: int) -> tuple[int, int]:
    """Experiment and first sample of the part of so many samples in which input j moves most."""
    most, liveliest = -1.0, (0, 0)
    for k, experiment in enumerate(experiments):
        movement = np.concatenate(([0.0], np.cumsum(np.diff(experiment.u[:, j]) ** 2)))
        last = max(len(experiment) - length, 0)
        for begin in (*range(0, last, length // 2), last):
            end = min(begin + length, len(experiment))
            moved = float(movement[end - 1] - movement[begin])
            if moved > most:
                most, liveliest = moved, (k, begin)
    return liveliest


def _variants(kind: str, damping: float, *, direct: bool) -> list[str]:
    """Kinds with a letter or a pole more or less than that of a model with this least damping.

    A zero beside a single pole is a direct term, which is tried only if the input allows it.
    """
    kinds = []
    lags = int(kind[1])
    if "U" in kind and damping > OVERDAMPED:
        kinds.append(kind.replace("U", ""))
    if "D" in kind:
        kinds.append(kind.replace("D", ""))
    if "Z" in kind:
        kinds.append(kind.replace("Z", ""))
    elif lags > 1 or (lags == 1 and (direct or "I" in kind)):
        kinds.append(f"{kind}Z")
    elif direct:
        # a lag beside a direct term
        kinds.append(f"P1{kind[2:]}Z")
    if lags > 1 and "U" not in kind:
        kinds.append(f"{kind}U")
    if 0 < lags < 3:
        kinds.append(f"P{lags + 1}{kind[2:]}")
        if "Z" not in kind:
            # either alone may cost more than it gains; a response that begins in the other direction looks like a delay
            larger = f"P{lags + 1}{kind[2:]}Z"
            kinds += [larger.replace("D", ""), larger] if "D" in kind else [larger]
    if lags > 1 and not (lags == 2 and "Z" in kind and not direct):
        fewer = kind[2:] if lags > 2 else kind[2:].replace("U", "")
        kinds.append(f"P{lags - 1}{fewer}")
    return kinds


@dataclass(frozen=True)
class _AtDelay:
    """A structure at a known delay, for initial estimates: its parameters are those of the structure itself."""

    structure: PathStructure
    delay: float

    @property
    def poles(self) -> int:
        """Number of poles, that of an integrator too."""
        return self.structure.poles

    @property
    def zeros(self) -> int:
        """Degree of the numerator."""
        return self.structure.zeros

    @property
    def integrators(self) -> int:
        """1 for an integrator, else 0."""
        return self.structure.integrators

    @property
    def resonates(self) -> bool:
        """Whether poles may be complex."""
        return self.structure.resonates

    def parameters(self, path: TransferFunction) -> FloatArray:
        """Parameters (p,) of a transfer function."""
        return self.structure.parameters(path)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A structure as far as the search refined it.

    Attributes:
        structure: That of every path.
        candidate: How it fits.
        criterion: Sum of squares of its errors.
        theta: Its parameters (p,).
        cost: Sum of squares at them.
    """

    structure: PathStructure
    candidate: Candidate
    criterion: OutputError
    theta: FloatArray
    cost: float


def _rank(fit: _Fit) -> float:
    """Criterion of a fit, larger where it has slow modes, which may follow a disturbance."""
    candidate = fit.candidate
    if not candidate.eligible:
        return candidate.bic + UNFIT
    return candidate.bic + (SLOW if np.isfinite(candidate.drive) else 0.0)


@dataclass(eq=False)
class _CandidateSearch:
    """Structures that were fitted to the same samples.

    Attributes:
        method: Name of the estimator.
        all_data: The experiments.
        compared: Those samples of them on which candidates are compared.
        offset: Whether outputs have constants.
        held: Whether the input moves in the first samples above all, which do not count for candidates with a delay
            unless it was held before them, as in a step test.
        longest_delay: Limit on the delays that are estimated, s.
        fits: What could be fitted.
        refusal: Why the last structure could not be.
    """

    method: str
    all_data: tuple[IOData, ...]
    compared: tuple[IOData, ...]
    offset: bool
    held: bool
    longest_delay: float
    fits: list[_Fit] = field(default_factory=list)
    refusal: SysidError | None = None

    @classmethod
    def of(cls, method: str, data: IOData | Sequence[IOData], offset: object, longest: int) -> "_CandidateSearch":
        """Begin a search; raises what `choose_tfest` raises of its arguments."""
        experiments = as_experiments(data, missing=True)
        if experiments[0].ny > 1:
            raise SysidError(
                f"the structure of {method} is chosen for one output, the data have {experiments[0].ny}: select one "
                "output, or give the structure"
            )
        longest = whole_number("longest", longest, 100)
        # such data have no candidates, each of which would say why in words of its own
        check_excitation(experiments, [0] * experiments[0].nu)
        compared = stretches(experiments, longest)
        limit = longest_delay(compared)
        delayed = OutputError(compared, [RationalPath(1, 0, None)] * compared[0].nu, limit, free=True)
        held = moves_early(delayed)
        return cls(method, experiments, compared, truth_value("offset", offset), held, limit)

    @property
    def _size(self) -> float:
        """Deviation of the output."""
        deviations = [float(np.nanstd(experiment.y)) for experiment in self.compared]
        return max(*deviations, float(np.finfo(float).tiny))

    @property
    def least(self) -> float:
        """Least criterion; infinite where nothing is fitted yet."""
        return min((fit.candidate.bic for fit in self.fits), default=np.inf)

    def data_of(self, structure: PathStructure, *, whole: bool = True) -> tuple[IOData, ...]:
        """The experiments that a structure is fitted to; an integrator's as they were before means were removed."""
        experiments = self.all_data if whole else self.compared
        if structure.integrators:
            return tuple(experiment.retrend() for experiment in experiments)
        return experiments

    def ranked(self) -> list[_Fit]:
        """All fits, the best first; of those that are equally good the one with fewer parameters.

        Raises:
            SysidError: Nothing could be fitted; the last reason.
        """
        if not self.fits:
            raise self.refusal or SysidError("no candidate could be fitted")
        by_criterion = sorted(self.fits, key=_rank)
        as_good = [fit for fit in by_criterion if _rank(fit) < _rank(by_criterion[0]) + SIMPLER]
        # of P2 and P2U that which does not allow for complex poles
        simplest = min(as_good, key=lambda fit: (fit.candidate.parameters, len(str(fit.candidate))))
        return [simplest, *(fit for fit in by_criterion if fit is not simplest)]

    @property
    def best_candidate(self) -> Candidate:
        """How the best fit fits."""
        return self.ranked()[0].candidate

    def best_structures(self, count: int, within: float = np.inf) -> list[PathStructure]:
        """Structures of the best fits, whose criteria lie within so much of the best."""
        ranked = self.ranked()
        limit = ranked[0].candidate.bic + within
        return [fit.structure for fit in ranked[:count] if fit.candidate.bic <= limit]

    @property
    def slowest(self) -> float:
        """Longest time constant of the fit with the least criterion, s."""
        poles = self._poles_of(min(self.ranked(), key=lambda fit: fit.candidate.bic))
        return float(np.max(-1.0 / poles.real, initial=0.0))

    @property
    def damping(self) -> float:
        """Least damping of a pole of the best fit."""
        poles = self._poles_of(self.ranked()[0])
        return float(np.min(-poles.real / np.abs(poles), initial=1.0))

    def _poles_of(self, fit: _Fit) -> ComplexArray:
        """Poles of a fit but for those of an integrator, rad/s."""
        poles = self._input_path(fit.criterion, fit.theta).poles()
        return poles[np.abs(poles) > 0.0]

    def bic_of(self, structure: PathStructure) -> float:
        """Criterion of a structure; infinite where it could not be fitted."""
        for fit in self.fits:
            if fit.structure == structure:
                return fit.candidate.bic
        return np.inf

    def ends_in_fast_poles(self) -> bool:
        """Whether the last structure has a pole faster than samples show, and hardly smaller errors by it."""
        if not self.fits or not self.fits[-1].candidate.doubt:
            return False
        losses = [fit.candidate.loss for fit in self.fits if fit.candidate.eligible]
        return bool(losses) and self.fits[-1].candidate.loss > (1.0 - HARDLY_SMALLER) ** 2 * min(losses)

    def fit_while_better(self, structures: Iterable[PathStructure], limit: float) -> None:
        """Fit structures, one after the other, up to the first that is worse than the one before or than a limit."""
        before = limit
        for structure in structures:
            self.fit(structure)
            criterion = self.bic_of(structure)
            if criterion > before or np.isinf(criterion):
                break
            before = criterion

    def fit_each(self, structures: Iterable[PathStructure]) -> None:
        """Fit several structures, one after the other."""
        for structure in structures:
            self.fit(structure)

    def fit(self, structure: PathStructure) -> None:
        """Fit a structure from the answers of smaller ones and from estimates of its own; again from the best one."""
        for fit in self.fits:
            if fit.structure == structure:
                self._fit_again(fit)
                return
        if hides_delay(structure) and self.all_data[0].intersample == "zoh":
            # the estimators refuse it
            return
        try:
            criterion = self._criterion(structure)
            minimum = self._minimum(criterion)
        except SysidError as error:
            self.refusal = error
            return
        self.fits.append(self._fit(structure, criterion, minimum))

    def _fit(self, structure: PathStructure, criterion: OutputError, minimum: Minimum) -> _Fit:
        """A structure with its minimum."""
        candidate = self._candidate(structure, criterion, minimum)
        return _Fit(structure, candidate, criterion, minimum.at.theta, minimum.at.cost)

    def _fit_again(self, fit: _Fit) -> None:
        """Improve a fit from the parameters of the best one, where these fit better than its own."""
        best = self.ranked()[0]
        if best is fit or best.structure.integrators != fit.structure.integrators:
            return
        start = fit.criterion(self._near(fit.structure, best))
        if start is None or start.cost >= fit.cost:
            return
        minimum = fit.criterion.minimum(start, STEPS, UNFINISHED / start.errors)
        self.fits[self.fits.index(fit)] = self._fit(fit.structure, fit.criterion, minimum)

    def _near(self, structure: PathStructure, fit: _Fit) -> FloatArray:
        """Parameters of a structure that are near a fit of another."""
        dt = fit.criterion.experiments[0].dt
        paths = fit.criterion.transfers(fit.theta)
        return np.concatenate([_reshaped(structure, path, dt) for path in paths])

    def _minimum(self, criterion: OutputError) -> Minimum:
        """A low minimum of a criterion, in few steps; of long records the search begins on a part of them."""
        screened = liveliest_parts(criterion.experiments, SCREENED, _samples_before(criterion))
        if screened is criterion.experiments:
            return quick_minimum(criterion, self._starts(criterion), STEPS, UNFINISHED)
        part = replace(criterion, experiments=screened)
        part = replace(part, held=criterion.held and moves_early(part))
        start = criterion(quick_minimum(part, self._starts(part), STEPS, UNFINISHED).at.theta)
        if start is None:
            raise SysidError("no initial estimate is stable: try fewer poles, or other delays")
        return criterion.minimum(start, STEPS, UNFINISHED / start.errors)

    def _criterion(self, structure: PathStructure) -> OutputError:
        """Sum of squares of the errors of a structure."""
        experiments = self.data_of(structure, whole=False)
        first = experiments[0]
        with_offset = self.offset and not structure.integrators
        criterion = OutputError(experiments, [structure] * first.nu, self.longest_delay, free=True, offset=with_offset)
        needed = criterion.sizes[-1] + len(experiments) * (first.nu * structure.poles + int(with_offset))
        if sum(criterion.usable()) <= needed:
            raise SysidError(f"too many orders for {sum(criterion.usable())} samples: {needed} unknowns")
        return replace(criterion, held=self.held and structure.delay is None)

    def _starts(self, criterion: OutputError) -> list[FloatArray]:
        """Parameters at which the search of a structure begins: of smaller ones, and by SRIVC at their delays."""
        structure = criterion.structures[0]
        nearest, no_delay = [], np.zeros(len(criterion.structures))
        for fit in sorted(self.fits, key=lambda fit: fit.candidate.bic):
            if fit.structure.integrators == structure.integrators:
                nearest.append(fit)
        starts = []
        for fit in nearest[:2]:
            starts.append(self._near(structure, fit))
        contains = any(
            fit.structure.poles >= structure.poles and fit.structure.zeros >= structure.zeros for fit in nearest
        )
        if contains:
            return starts
        delays = [no_delay]
        delayed = [fit for fit in nearest if fit.structure.delay is None]
        beyond = self.longest_delay - LONGEST_DELAY * self.compared[0].dt
        if structure.delay is None and delayed:
            # that of the best so far
            delays = [np.array([path.delay for path in delayed[0].criterion.transfers(delayed[0].theta)])]
        elif structure.delay is None and beyond > 0.0:
            # what the quick look at all delays has found
            delays.append(no_delay + beyond)
        elif structure.delay is None:
            delays += [no_delay + share * criterion.longest for share in (0.2, 0.5)]
        for known in delays:
            starts += self._own_starts(criterion, known)
        return starts

    def _own_starts(self, criterion: OutputError, delays: FloatArray) -> list[FloatArray]:
        """Initial estimates by SRIVC at known delays (nu,), s, on the beginning of the records."""
        structures: list[Any] = []
        for structure, delay in zip(criterion.structures, delays, strict=True):
            structures.append(_AtDelay(structure, float(delay)))
        first = [criterion.first(experiment) for experiment in criterion.experiments]
        return initial_estimates(
            criterion.experiments,
            structures,
            first,
            criterion.longest,
            free=criterion.free,
            offset=criterion.offset,
            effort=QUICK,
        )

    def _candidate(self, structure: PathStructure, criterion: OutputError, minimum: Minimum) -> Candidate:
        """How a structure fits."""
        at, samples = minimum.at, 0
        squares = parameters = 0.0
        for experiment in criterion.experiments:
            errors = self._counted_errors(criterion, experiment, at.theta)
            samples += len(errors)
            squares += float(errors @ errors)
        deviation = max(float(np.sqrt(squares / samples)), ROUNDING * self._size)
        # the expected decrease of the errors by a parameter is larger where errors are coloured [White1982]
        half, _ = directions(at)
        tables = [criterion.columns(experiment, at.theta)[0] for experiment in criterion.experiments]
        middle = coloured_information(tables, min(COLOUR, at.errors // 20), half) if squares else np.eye(half.shape[1])
        parameters = float(np.trace(middle)) / half.shape[1] * (len(at.theta) + at.transients)
        bic = 2.0 * samples * np.log(deviation) + parameters * np.log(samples)
        poles = self._input_path(criterion, at.theta).poles()
        # the pole of an integrator is where its structure has it
        poles = poles[np.abs(poles) > 0.0]
        radius = float(np.exp(criterion.experiments[0].dt * poles.real.max(initial=-np.inf)))
        loss = at.cost / at.errors
        drive = _drive(criterion, minimum, half, tables)
        # such a pole and the delay have nearly one effect, and neither has a value
        is_fast = float(np.abs(poles).max(initial=0.0)) * criterion.experiments[0].dt > FASTEST
        doubt = "a pole faster than samples show" if is_fast else ""
        orders = self._orders(structure)
        return Candidate(self.method, orders, len(at.theta), loss, bic, np.nan, radius, drive, doubt=doubt)

    def _counted_errors(self, criterion: OutputError, experiment: IOData, theta: FloatArray) -> FloatArray:
        """Errors of an experiment behind the longest delay of any candidate, which all have."""
        errors = criterion.columns(experiment, theta)[0][:, -1]
        if self.held:
            return errors
        first = max(experiment.window, math.ceil(self.longest_delay / experiment.dt - TIGHT) + 1)
        return errors[-max(int(experiment.known[first:].sum()), 1) :]

    def _input_path(self, criterion: OutputError, theta: FloatArray) -> ContinuousModel:
        """The continuous-time model."""
        first = criterion.experiments[0]
        summary = DataSummary.of(criterion.experiments)
        return RealisePaths((tuple(criterion.structures),), summary, first.intersample, None)(theta)

    def _orders(self, structure: PathStructure) -> dict[str, Any]:
        """Orders by name, as a candidate shows them."""
        if isinstance(structure, ProcessPath):
            return {"kind": structure.kind}
        delay = "estimated" if structure.delay is None else 0
        return {"poles": structure.poles, "zeros": structure.zeros, "delay": delay}

    def choice(self, estimate: Callable[[PathStructure, FloatArray], ContinuousEstimate]) -> StructureChoice:
        """The best candidate, estimated from all data, and the others."""
        ranked = self.ranked()
        best = ranked[0]
        samples, total = sum(map(len, self.compared)), sum(map(len, self.all_data))
        criterion = "the lowest BIC of output errors of any colour"
        if any(fit.candidate.bic < best.candidate.bic for fit in ranked):
            criterion += ", of those that may be chosen"
        candidates = tuple(fit.candidate for fit in ranked)
        return StructureChoice(
            estimate=estimate(best.structure, best.theta),
            candidates=candidates,
            delays=(),
            samples=samples,
            cautions=self._cautions(candidates),
            reason=f"{candidates[0]}: {criterion} of {len(ranked)} candidates, compared on {samples} of {total} "
            "samples",
            disagreement=self._disagreement(ranked),
        )

    def _cautions(self, candidates: Sequence[Candidate]) -> tuple[str, ...]:
        """What the choice could not tell."""
        cautions = []
        if not candidates[0].eligible:
            cautions.append(candidates[0].remark)
        if len(candidates) == 1 and self.refusal is not None:
            cautions.append(f"no other candidate could be fitted, so that nothing was chosen: {self.refusal}")
        return tuple(cautions)

    def _disagreement(self, ranked: Sequence[_Fit]) -> tuple[float, float]:
        """Largest ratios of gain and bandwidth between the best candidate and those that are hardly worse."""
        models = []
        for fit in ranked:
            is_near = fit.candidate.bic < ranked[0].candidate.bic + HARDLY_TOLD
            if fit.candidate.eligible and is_near:
                models.append(self._input_path(fit.criterion, fit.theta))
        if not models or any(not np.isfinite(model.dc_gain()).all() for model in models):
            return 1.0, 1.0
        return (
            largest_ratio([np.abs(model.dc_gain()).ravel() for model in models]),
            largest_ratio([model.bandwidth().ravel() for model in models]),
        )

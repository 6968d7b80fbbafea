"""Identification of a model from records: estimate, operating point, bandwidth claims, fits and residual test."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import sysid
from scenarios.experiments.joint_inputs import LAGS
from scenarios.files.data_file import excited
from scenarios.files.errors import MissingRecordError, ScenarioError, unknown
from scenarios.identification.adapted_estimators import integrates
from scenarios.identification.methods import ESTIMATORS, estimate
from scenarios.identification.run_agreement import RunAgreement, run_agreement
from sysid import Bandwidth, Estimate, FrequencyResponse, IOData, ModelFit, ResidualTest, SysidError
from sysid.models.bandwidth import INTEGRATES, BandwidthClaim, bandwidth_claim
from sysid.models.continuous_estimate import ContinuousEstimate, sampled_poles
from sysid.models.static_gain import gain_told_by
from sysid.polynomial.fit_with_offset import fit_with_offset, subtract_means, unexplained_offsets
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import trends_of_outputs
from sysid.polynomial.trends import LINE, best_degree, subtract_lines, trend_degree
from sysid.polynomial.weighted_output_errors import UNWEIGHTED
from sysid.records.arrays import FloatArray
from sysid.records.data import complete_parts
from sysid.records.errors import Message, reworded
from sysid.records.excited_band import excited_band, hann_power, lowest_strong_line, not_leakage
from sysid.records.resolution import resolution
from sysid.validation.command_baseline import CommandBaseline, command_baseline
from sysid.validation.input_independence import LIMIT, input_independence
from sysid.validation.model_error import ModelError, model_error
from sysid.validation.nonlinearity import NonlinearityTest, nonlinearity
from sysid.validation.slow_response import SlowResponse, slow_response
from sysid.validation.structure_scan import Order

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHORTEST = 100
"""Shortest part between two gaps that is used, samples: the initial conditions would take most of a shorter one."""

ROUNDED = 1.1
"""Residuals, relative to the deviation of rounding, up to which nothing but rounding shows in them."""

FINE = 0.005
"""Deviation of rounding, relative to that of the output, up to which it matters no more than a nonlinearity would."""

RISING = 3.0
"""Ratio of two frequencies, the lower one that of the record, between which the gain of an integrator falls as much."""

LASTING = 10.0
"""Records that the time constant of a mode must last to count as an integrator."""

SURELY = 1e-3
"""p-value below which a residual test fails for sure."""

GRID = 60
"""Frequencies at which intervals with distortion and order are computed."""

WIDEST_STEP = 1.1
"""Ratio of neighbouring ones of them, at most."""

BELOW = 0.2
"""Lowest of them but 0 Hz, relative to the lowest strong line of the input."""

COHERENT = 0.5
"""Least coherence of the nonparametric response that is drawn: below, it shows the disturbance."""

SIDE_LOBES = 10 ** (-42.7 / 20)
"""Highest side lobe of the Hamming window over its peak: with less power than this, an estimate is leakage."""

DRAWN = 2000
"""Samples of measured and model outputs that are drawn, of longer records the first."""


@dataclass(frozen=True)
class FittedModel:
    """A model estimated from records.

    Attributes:
        estimate: The model.
        orders: All its orders by name.
        parts: The records about the operating point of the estimate, which has none where the means were left in.
        band: Bandwidth of every path with its interval.
        claims: The same (ny, nu), withheld where the record cannot support it.
    """

    estimate: Estimate
    orders: dict[str, Order | str]
    parts: tuple[IOData, ...]
    band: Bandwidth
    claims: tuple[tuple[BandwidthClaim, ...], ...]

    @property
    def is_slower_than_records(self) -> bool:
        """Whether a mode lasts so much longer than the records that its gain at 0 Hz means nothing.

        A pole at 1 - d acts on the lowest frequency of the records, w, as one at 1 does but for d/w. Estimates of two
        poles at one are a pair far from it, 1 - d1 and 1 - d2: the factor is 1 + (d1 + d2)/jw - d1 d2/w^2.
        """
        longest = max(map(len, self.parts))
        lasting = 1.0 / (LASTING * longest)
        distances = 1.0 - sampled_poles(self.estimate)
        # one alone, or two that together are a double integrator
        slowest = distances[np.argsort(np.abs(distances))[:2]]
        if (np.abs(slowest) < lasting).any():
            return True
        lowest = 2.0 * np.pi / longest
        is_pair = len(slowest) == 2
        return bool(is_pair and abs(slowest.sum()) < 2.0 * lasting and abs(slowest.prod()) < lowest * lasting)

    @property
    def integrates(self) -> NDArray[np.bool_]:
        """Whether each path (ny, nu) is an integrator for the records: its gain rises towards their lowest frequency.

        Nothing depends on gain at 0 Hz and bandwidth of such a path. A slow mode whose zero lies beside it is none.
        """
        dt = self.parts[0].dt
        lowest = 1.0 / (max(map(len, self.parts)) * dt)
        response = self.estimate.frequency_response(lowest * np.array([1.0, RISING]))
        first, second = np.abs(response.response)
        return self.is_slower_than_records & (first > np.sqrt(RISING) * second)

    @property
    def gain(self) -> FloatArray:
        """Gain at 0 Hz of every path (ny, nu), NaN of those that integrate for the records."""
        return gain_told_by(self.estimate, self.parts[0].dt, max(map(len, self.parts)))

    @property
    def is_unstable(self) -> bool:
        """Whether a mode that the input drives grows; an integrator does not."""
        path = self.estimate.model.input_path()
        return bool(np.abs(path.poles()).max(initial=0.0) > 1.0 + INTEGRATES)

    @property
    def weighting(self) -> tuple[int, int] | None:
        """Degrees (nc, nd) of the disturbance model C/D that weighted the errors; None for equal weights."""
        beside = self.estimate.diagnostics.get("weighting")
        return None if beside is None else (len(beside.C) - 1, len(beside.D) - 1)


@dataclass(frozen=True)
class Identification:
    """A fitted model judged on records.

    Attributes:
        fitted: The model.
        judged: The model behind `fit` and `test`: `fitted` itself, or one of the same orders estimated without
            `checked`, where `fitted` is of all samples.
        checked: The records that it is judged on: its own, or others.
        fit: Fits to `checked`.
        test: Residual test on `checked`; None where it cannot be made.
        untested: Why not.
        warnings: Remarks on gaps, bandwidths and numerics.
        cautions: What the choice of the model could not tell from the record, for which no verdict calls it sufficient.
        disagreement: Ratios of gain and bandwidth to structures that fit as well, of a choice; see `StructureChoice`.
        same_sample: Whether the choice left a direct term out that could be that of a controller.
        chose_trend: Whether a straight line in the output was a candidate of its choice.
        rounded: Whether the residuals of each output are no larger than the rounding of its values, as by an encoder
            (ny,): they are then a function of the output, and hence of the input, of a true model too.
        baseline: Fit of the commands themselves to `checked`; None where inputs and outputs differ in number or units.
        nonlinearity: Test of nonlinear dependence on the input, on the records of the fit; None of unstable models.
        agreement: Whether the runs that the model is of have one response; None of one run.
        test_of_all: Residual test of a model that was estimated again, on all samples, where `test` fails.
        slow: What the simulation errors tell of slow parts of the response, path by path, on the records of the fit.
        error: Gains with intervals for the best linear system at 0 Hz and over the band of the input, on the records of
            the fit; None of models without a gain that could be compared.
        on_own_records: Whether `checked` are the records that the model is estimated from.
    """

    fitted: FittedModel
    judged: FittedModel
    checked: tuple[IOData, ...]
    fit: ModelFit
    test: ResidualTest | None
    untested: str
    warnings: tuple[str, ...]
    cautions: tuple[str, ...] = ()
    rounded: tuple[bool, ...] = ()
    disagreement: tuple[float, float] = (1.0, 1.0)
    same_sample: bool = False
    chose_trend: bool = False
    nonlinearity: NonlinearityTest | None = None
    baseline: CommandBaseline | None = None
    agreement: RunAgreement | None = None
    slow: tuple[SlowResponse, ...] = ()
    test_of_all: ResidualTest | None = None
    error: ModelError | None = None
    on_own_records: bool = True

    @property
    def is_estimated_again(self) -> bool:
        """Whether the model was estimated again, from all samples, after one of the same orders had been judged."""
        return self.fitted is not self.judged

    @property
    def nonlinear(self) -> tuple[int, ...]:
        """Numbers of the outputs that depend nonlinearly on the input, so that it matters; rounding is none."""
        if self.nonlinearity is None:
            return ()
        rounded = self.rounded or (False,) * len(self.nonlinearity.kinds)
        materials = zip(self.nonlinearity.material.tolist(), rounded, strict=True)
        return tuple(i for i, (is_material, is_rounded) in enumerate(materials) if is_material and not is_rounded)

    @property
    def depends_on_input(self) -> bool:
        """Whether the test finds residuals that depend on the input, and rounding does not explain them."""
        if self.test is None:
            return False
        explained = np.array(self.rounded) if self.rounded else np.zeros(len(self.test.independent), dtype=bool)
        return bool((~(self.test.independent | self.by_chance).all(axis=1) & ~explained).any())

    @property
    def by_chance(self) -> NDArray[np.bool_]:
        """Whether the test of each pair (ny, nu) fails by chance: on all samples, which tell more, it does not fail.

        A test at 1 % fails one right model of a hundred; one that fails at `SURELY` does not fail by chance.
        """
        if self.test is None or self.test_of_all is None:
            return np.zeros((len(self.fit.simulation), self.fitted.parts[0].nu), dtype=bool)
        fails_little = ~self.test.independent & (self.test.independence_p > SURELY)
        return np.asarray(fails_little & self.test_of_all.independent)

    def _nonlinearity_record(self) -> dict[str, object] | None:
        """Test of nonlinear dependence on the input, per output."""
        test = self.nonlinearity
        if test is None:
            return None
        outputs = range(len(test.kinds))
        kinds = [test.kinds[i] if i in self.nonlinear else "" for i in outputs]
        seen = [i in self.nonlinear for i in outputs]
        return {
            "seen": seen,
            "p": test.p_values,
            "distortion": test.distortion,
            "kind": kinds,
            "hidden": list(test.hidden),
        }

    def record(self) -> dict[str, object]:
        """Return what `hmtb identify --json` prints of it; of a single path numbers, else rows of outputs."""
        fitted, fit, model, first = self.fitted, self.fit, self.fitted.estimate, self.fitted.parts[0]
        bandwidths = [[claim.hz for claim in row] for row in fitted.claims]
        intervals = [[[claim.low, claim.high] for claim in row] for row in fitted.claims]
        gains = fitted.gain.tolist()
        is_single_path = first.nu == first.ny == 1
        residuals = None
        if self.test is not None:
            residuals = {name: getattr(self.test, name) for name in ("passed", "whiteness_p", "independence_p")}
            if self.test_of_all is not None:
                residuals["independence_p_of_all_samples"] = self.test_of_all.independence_p
        point = model.operating_point
        if point is not None:
            # an output that integrates rests at any level
            point = point[0], np.where(np.isfinite(fitted.gain).all(axis=1), point[1], np.nan)
        return {
            "orders": fitted.orders,
            "weighting": fitted.weighting and list(fitted.weighting),
            "inputs": first.input_names,
            "outputs": first.output_names,
            "fit": {name: getattr(fit, name) for name in ("simulation", "one_step", "steps", "ahead")},
            "bandwidth_hz": bandwidths[0][0] if is_single_path else bandwidths,
            "ci95": intervals[0][0] if is_single_path else intervals,
            **_roots(model),
            "dc_gain": gains[0][0] if is_single_path else gains,
            "parameters": dict(zip(model.parameter_names, model.parameters, strict=True)),
            "deviations": dict(zip(model.parameter_names, deviations(model), strict=True)),
            "noise_covariance": model.noise_variance,
            "fpe": model.fpe,
            "aic": model.aic,
            "bic": model.bic,
            "residuals": residuals,
            "nonlinearity": self._nonlinearity_record(),
            "model_error": self._error_record(),
            "baseline": self.baseline and {"fit": self.baseline.fit, "delays": self.baseline.delays},
            "agreement": None if self.agreement is None else self.agreement.record(),
            "operating_point": point and dict(zip(("input", "output"), point, strict=True)),
            "samples": sum(map(len, fitted.parts)),
            "dt": first.dt,
        }

    def _error_record(self) -> dict[str, object] | None:
        """Gains with both intervals, frequency by frequency (nf, ny, nu), for `--json`."""
        error = self.error
        if error is None:
            return None
        return {
            "hz": error.frequencies,
            "gain": error.gain,
            "noise_alone": list(error.noise_alone),
            "with_distortion_and_order": list(error.interval),
            "p_values": error.p_values,
            "reasons": list(error.reasons),
            "strong_line_hz": error.strong_line,
            "bandwidth": _bandwidth_record(error.bandwidth()),
            "bandwidth_from_strong_line": _bandwidth_record(error.bandwidth(error.strong_line)),
        }


def fit_model(
    records: Sequence[IOData],
    method: str,
    orders: Sequence[Order | str],
    *,
    keep_mean: bool = False,
    check: Sequence[IOData] | None = None,
    trend: Mapping[str, bool] | None = None,
    weighting: tuple[int, int] = UNWEIGHTED,
    found: Estimate | None = None,
    near: Estimate | None = None,
) -> FittedModel:
    """Estimate a model with its operating point, and weigh its bandwidths against the records.

    Args:
        records: Records without gaps that the method cannot use.
        method: One of `ESTIMATORS`.
        orders: Its orders.
        keep_mean: Whether to take values as they are, without an operating point.
        check: Records that judge the model; None if these do.
        trend: Options of the estimator for a constant or a straight line in the output; without them a constant is
            estimated in turns with the model, beside `keep_mean` none.
        weighting: Of oe the degrees of C and D of the model of the disturbance that weights its errors.
        found: The model where it is known from a choice of orders on the same records about their means; None
            estimates it.
        near: A model of the same orders of almost the same records, at which searches begin; None without one.

    Raises:
        ScenarioError: Unknown method, wrong orders, several outputs for a method that takes one, a trend for a method
            that knows none.
        SysidError: The estimator refuses the records.
    """
    first = records[0]
    if method in ESTIMATORS and first.ny > 1 and not ESTIMATORS[method].outputs:
        several = ", ".join(name for name, estimator in ESTIMATORS.items() if estimator.outputs)
        raise ScenarioError(f"{method} takes one output, given {first.ny}; for several there are: {several}")
    run = partial(estimate, method=method, orders=orders, **_weighting_option(method, weighting))
    # searches about other operating points, or of more samples, begin there
    run = partial(run, **_start(method, found or near))
    with warnings.catch_warnings():
        # The remarks of `Identification` repeat them in the words of the command line.
        warnings.simplefilter("ignore", sysid.SysidWarning)
        if any(weighting) and not trend:
            # the constant that such a model is estimated with is another one than that of its own errors
            found = None
        keep_mean, trend = _operating_point_options(
            method, orders, keep_mean=keep_mean, trend=trend, weighting=weighting
        )
        if trend:
            _check_trend(method, trend)
            shifted = subtract_means(records)
            model = found or partial(run, **trend)(shifted)
            used = _without_trends(model, shifted)
        elif keep_mean:
            model, used = found or run(tuple(records)), tuple(records)
        else:
            about_point = fit_with_offset(run, records, found=found)
            model, used = about_point.estimate, about_point.parts
        band, longest = model.bandwidth(), max(used, key=len)
        claims = []
        for i in range(first.ny):
            claim = partial(bandwidth_claim, model, longest, output=i, band=band, judged=check or ())
            claims.append(tuple(claim(input=j) for j in range(first.nu)))
    complete = ESTIMATORS[method].complete(orders)
    if "nk" in model.orders and "nk" not in complete:
        # known delays of a state-space model, which its choice finds
        complete["nk"] = model.orders["nk"]
    return FittedModel(model, complete, used, band, tuple(claims))


def _start(method: str, near: Estimate | None) -> dict[str, Any]:
    """The argument `start=` of an estimator that begins its search at a model; empty if it takes none."""
    if near is None or "start" not in signature(ESTIMATORS[method].function).parameters:
        return {}
    if isinstance(near, ContinuousEstimate):
        return {"start": near.parameters}
    return {"start": near if near.polynomials is None else near.polynomials}


def _weighting_option(method: str, weighting: tuple[int, int]) -> dict[str, Any]:
    """The option of the estimator that weights its errors; empty without one.

    Raises:
        ScenarioError: A weighting for another method than oe.
    """
    if not any(weighting):
        return {}
    if method != "oe":
        raise ScenarioError(
            f"--weighting {' '.join(map(str, weighting))} given with --method {method}; expected --method oe"
        )
    return {"weighting": weighting}


def _operating_point_options(
    method: str,
    orders: Sequence[Order | str],
    *,
    keep_mean: bool,
    trend: Mapping[str, bool] | None,
    weighting: tuple[int, int] = UNWEIGHTED,
) -> tuple[bool, Mapping[str, bool] | None]:
    """Whether a method takes the values as they are, and its options for the output's trend.

    Continuous-time models, and those with weighted errors, have the constant of the output among their unknowns.
    Integrators have it in their state: the mean of the input is no operating point of theirs, it would put a ramp into
    the output.
    """
    if method == "procest" and any(map(integrates, orders)):
        return True, None
    has_own_constant = method in ("tfest", "procest") or any(weighting)
    if has_own_constant and not keep_mean and not trend:
        return False, {"offset": True}
    return keep_mean, trend


def trend_options(*, offset: bool, trend: bool, keep_mean: bool) -> dict[str, bool]:
    """Options of an estimator for a constant or a straight line in the output that is asked for.

    Raises:
        ScenarioError: Values as they are, `keep_mean`, are asked for too.
    """
    if keep_mean and (offset or trend):
        raise ScenarioError(
            f"--keep-mean and {'--trend' if trend else '--offset'} given; expected one: the values as they are, or "
            "about an operating point"
        )
    return {name: True for name, is_asked in (("offset", offset), ("trend", trend)) if is_asked}


def drifts(records: Sequence[IOData]) -> bool:
    """Whether a single output follows a straight line beside its response to the input."""
    parts = complete_parts(records)
    return records[0].ny == 1 and bool(parts) and best_degree(parts) == LINE


def relative_to_measured(fit: ModelFit, checked: Sequence[IOData], measured: Sequence[IOData]) -> ModelFit:
    """Fits relative to the outputs as they were measured, where lines that were subtracted made them larger.

    An integrator takes any line for its own, and so does a disturbance that walks: the outputs without such a line may
    be many times as large as they are, and errors nothing relative to them.

    Args:
        fit: Fits to the records without their constants and lines.
        checked: These records.
        measured: The records as they were.
    """
    by_experiment = []
    for k, of_experiment in enumerate(fit.by_experiment):
        by_experiment.append(relative_to_measured(of_experiment, checked[k : k + 1], measured[k : k + 1]))
    # A real drift makes the measured outputs larger: fits are then relative to what is left of them.
    ratio = _spread(checked) / _spread(measured)
    fits = {}
    for name in ("simulation", "one_step", "ahead"):
        value = getattr(fit, name)
        fits[name] = np.where(ratio > 1.0, 100.0 - (100.0 - value) * ratio, value)
    return replace(fit, **fits, by_experiment=tuple(by_experiment))


def _spread(records: Sequence[IOData]) -> FloatArray:
    """Root of the sum of squares of every output (ny,), each record about its own mean, without its initial window."""
    squares = 0.0
    for record in records:
        y = record.scored.y
        squares = squares + np.nansum((y - np.nanmean(y, axis=0)) ** 2, axis=0)
    return np.sqrt(squares)


def _check_trend(method: str, trend: Mapping[str, bool]) -> None:
    """Refuse options for a trend that the estimator does not have."""
    if method not in ESTIMATORS:
        raise ScenarioError(unknown("method", method, ESTIMATORS))
    known = signature(ESTIMATORS[method].function).parameters
    for option in trend:
        if option not in known:
            able = [name for name, entry in ESTIMATORS.items() if option in signature(entry.function).parameters]
            raise ScenarioError(f"{method} has no {option}; expected one of {', '.join(able)}")


def _without_trends(model: Estimate, parts: Sequence[IOData]) -> tuple[IOData, ...]:
    """The records that a model was estimated from, without the trends that it found in them."""
    offsets, slopes = model.diagnostics["offsets"], model.diagnostics.get("slopes")
    if isinstance(model, ContinuousEstimate):
        # one sequence for each output, not for each experiment
        offsets = list(zip(*offsets, strict=True))
    return subtract_lines(parts, offsets, slopes)


def identify(
    records: Sequence[IOData],
    method: str,
    orders: Sequence[Order | str],
    *,
    keep_mean: bool = False,
    trend: Mapping[str, bool] | None = None,
    weighting: tuple[int, int] = UNWEIGHTED,
    found: Estimate | None = None,
    steps: int = 1,
    check: Sequence[IOData] | None = None,
    continued: bool = False,
    whole: Sequence[IOData] | None = None,
) -> Identification:
    """Fit a model and judge it on records.

    Args:
        records: Records to estimate from, as `usable` returns them.
        method: One of `ESTIMATORS`.
        orders: Its orders.
        keep_mean: Whether to take values as they are, without an operating point.
        trend: Options of the estimator for a constant or a straight line in the output, as in `fit_model`.
        weighting: Of oe the degrees of C and D of the model of the disturbance that weights its errors.
        found: The model where it is known, likewise.
        steps: Horizon of the further prediction, samples.
        check: Records to judge on; `records` when None.
        continued: Whether these continue the records, so that the operating point of the model is theirs too: of other
            records its dynamics tell one.
        whole: Records of which `records` and `check` are parts, from which the model is estimated again after it was
            judged, as every sample makes it more accurate; None leaves it as it was judged.

    Raises:
        ScenarioError: See `fit_model`.
        SysidError: The estimator refuses the records.
    """
    fit = partial(fit_model, keep_mean=keep_mean, trend=trend, weighting=weighting)
    fitted = judged = fit(records, method, orders, found=found, check=check)
    if whole is not None:
        fitted = _of_all_samples(judged, whole, partial(fit, method=method, orders=orders))
    keep_mean, trend = _operating_point_options(method, orders, keep_mean=keep_mean, trend=trend, weighting=weighting)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        checked = tuple(check or records)
        if check is not None and continued and judged.estimate.operating_point is not None:
            checked = _about_continued_points(judged, records, checked)
        elif trend:
            checked = judged.parts if check is None else _about_own_trends(judged.estimate, checked, trend)
        elif not keep_mean:
            # Records to judge on have an operating point of their own, which the model's dynamics tell.
            checked = subtract_means(checked)
            offsets, _, _ = unexplained_offsets(judged.estimate.model, checked)
            checked = tuple(record.subtract(y=offset) for record, offset in zip(checked, offsets, strict=True))
        (fit_to_checked,) = sysid.compare({method: judged.estimate}, checked, steps=steps)
        fit_to_checked = relative_to_measured(fit_to_checked, checked, tuple(check or records))
        test, test_of_all, untested = None, None, ""
        try:
            test = sysid.resid(judged.estimate, checked)
            if fitted is not judged and not test.independent.all():
                test_of_all = sysid.resid(fitted.estimate, fitted.parts)
        # Without a test, the simulated fit alone gives the verdict.
        except SysidError as error:
            untested = str(error)
        run = partial(estimate, method=method, orders=orders, **_weighting_option(method, weighting))
        agreement = run_agreement(fitted.estimate, fitted.parts, run)
    remarks = _remarks(fitted, judged_on_own_records=check is None)
    return Identification(
        fitted,
        judged,
        checked,
        fit_to_checked,
        test,
        untested,
        remarks,
        rounded=_rounded(records, test, judged),
        nonlinearity=nonlinearity(fitted.estimate, fitted.parts),
        baseline=command_baseline(judged.parts, checked),
        agreement=agreement,
        slow=slow_response(fitted.estimate, fitted.parts),
        test_of_all=test_of_all,
        error=gains_with_error(fitted),
        on_own_records=check is None,
    )


def _bandwidth_record(band: Bandwidth) -> dict[str, object]:
    """Bandwidths with the ends of their intervals (ny, nu) each, Hz."""
    return {"hz": band.hz, "ci95": list(band.ci95)}


def gains_with_error(fitted: FittedModel) -> ModelError | None:
    """Gains with intervals for the best linear system: at 0 Hz, over the band of the input, and at bandwidths.

    None of unstable models and integrators, and of impulse responses, whose coefficients are as free as any error.
    """
    if fitted.is_unstable or fitted.integrates.any() or fitted.estimate.method == "impulseest":
        return None
    parts = fitted.parts
    line = lowest_strong_line([part.scored for part in parts])
    highest = max(excited_band(part, input=j)[1] for part in parts for j in range(part.nu))
    nyquist = 0.5 / parts[0].dt
    of_claims = [claim.hz for claims in fitted.claims for claim in claims if np.isfinite(claim.hz)]
    # Below the line, a bandwidth relative to 0 Hz may lie; from it on, one relative to the gain there, or claimed ones.
    lowest, highest = BELOW * line, min(max(highest, 2.0 * line, *of_claims), nyquist)
    # A wide band needs more, so that none of them is too far from the next for a bandwidth between them.
    over_band = np.geomspace(lowest, highest, max(GRID, round(np.log(highest / lowest) / np.log(WIDEST_STEP))))
    frequencies = np.unique(np.minimum([0.0, line, *over_band, *of_claims], nyquist))
    with suppress(SysidError), warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        return model_error(fitted.estimate, parts, frequencies)
    return None


def _of_all_samples(judged: FittedModel, whole: Sequence[IOData], fit: Callable[..., FittedModel]) -> FittedModel:
    """A judged model estimated again from all samples; as it was where they give none that is stable like it."""
    model = judged.estimate
    try:
        again = fit(whole, near=model)
    except SysidError:
        return judged
    return again if again.is_unstable == judged.is_unstable else judged


def _about_own_trends(model: Estimate, records: Sequence[IOData], trend: Mapping[str, bool]) -> tuple[IOData, ...]:
    """Records about the constants or lines of their own in the output that the dynamics of a model tell."""
    about = subtract_means(records)
    if model.polynomials is None:
        offsets, _, _ = unexplained_offsets(model.model, about)
        return tuple(record.subtract(y=offset) for record, offset in zip(about, offsets, strict=True))
    orders = replace(Orders.of(model.polynomials, padded=True), trend=trend_degree(**trend))
    trends = trends_of_outputs(about, orders, orders.parameters(model.polynomials))
    return tuple(record.subtract(y=line[:, None]) for record, line in zip(about, trends, strict=True))


def _rounded(records: Sequence[IOData], test: ResidualTest | None, fitted: FittedModel) -> tuple[bool, ...]:
    """Whether the residuals of each output are no larger than the fine rounding of its records to steps (ny,).

    Rounding to coarse steps is a nonlinearity: gain and bandwidth of a model that follows it may be far from the truth.
    An integrator has neither, and its output moves over any step.
    """
    if test is None:
        return ()
    outputs = np.concatenate([record.y for record in records])
    steps = np.array([resolution(channel) for channel in outputs.T])
    integrating = fitted.integrates.any(axis=1)
    # On records held out an integrator runs away by the error of its slope: the records of the fit tell its rounding.
    squares = np.where(
        integrating, np.nanmean(fitted.estimate.residuals**2, axis=0), np.nanmean(test.residuals**2, axis=0)
    )
    # Rounding to steps q has a variance of q^2/12.
    rounding = steps / np.sqrt(12.0)
    is_fine = (rounding <= FINE * np.nanstd(outputs, axis=0)) | integrating
    return tuple(bool(is_rounding) for is_rounding in (np.sqrt(squares) <= ROUNDED * rounding) & is_fine)


def _about_continued_points(
    fitted: FittedModel, records: Sequence[IOData], checked: Sequence[IOData]
) -> tuple[IOData, ...]:
    """Records that continue those of the estimate, about the operating points of their runs and along their lines.

    A line in the output goes on where the record of the estimate ended. It is that of the record with the same name.
    """
    inputs, outputs = fitted.estimate.operating_point or (0.0, 0.0)
    slopes = fitted.estimate.diagnostics.get("slopes", [None] * len(records))
    about = []
    for record in checked:
        input_level, level = inputs, np.broadcast_to(outputs, record.y.shape)
        for part, of_model, slope in zip(records, fitted.parts, slopes, strict=True):
            if part.name != record.name:
                continue
            if of_model.input_offset is not None and of_model.output_offset is not None:
                input_level, level = of_model.input_offset, np.broadcast_to(of_model.output_offset, record.y.shape)
            if slope is not None:
                middle = part.start + 0.5 * (len(part) - 1) * part.dt
                level = level + (record.time - middle)[:, None] * np.array(slope)
        about.append(record.subtract(u=input_level, y=level))
    return tuple(about)


FROM_REST = (
    ". If the record begins where the input was switched on, and the system was at rest before, the switching is the "
    "step of a step test: put a row of rest in front (input and output at their values before), or fit "
    "sysid.procest(data, 'P1D', initial_conditions='zero') with input and output as differences from rest"
)
"""Advice on an input that is constant from the first sample."""


def usable(records: Sequence[IOData], skip: float, path: Path, test: str | None = None) -> tuple[IOData, ...]:
    """Leave out the start, and records of which too little is known.

    Args:
        records: As read.
        skip: Length of the start that is left out, s.
        path: File of the records, for messages.
        test: Which test of the file, likewise.

    Raises:
        ScenarioError: Too little is left, or a channel is constant.
    """
    dt, samples = records[0].dt, sum(map(len, records))
    if not 0 <= skip < (samples - 1) * dt:
        raise ScenarioError(
            f"{path.name}: skip must be 0 to less than the record's {samples * dt:g} s, given {skip:g} s"
        )
    # The start is that of all records together: it may reach over a gap.
    to_skip, kept = round(skip / dt), []
    for record in records:
        if len(record) > to_skip:
            kept.append(record[to_skip:])
        to_skip = max(to_skip - len(record), 0)
    _check_channels_move(kept, path, test)
    # A single record without gaps may be short: the estimator itself says what it needs.
    if len(kept) == 1 and kept[0].complete:
        return (kept[0],)
    long_enough = [record for record in kept if record.known.all(axis=1).sum() >= SHORTEST]
    if not long_enough:
        raise ScenarioError(f"{path.name}: between the gaps no part has {SHORTEST} samples; nothing to identify from")
    return tuple(long_enough)


def _check_channels_move(records: Sequence[IOData], path: Path, test: str | None) -> None:
    """Refuse constant channels, before the mean is removed, which would leave rounding where there was a constant."""
    first = records[0]
    inputs, outputs = np.concatenate([record.u for record in records]), np.concatenate([record.y for record in records])
    for side, values, names in (("input", inputs, first.input_names), ("output", outputs, first.output_names)):
        for column, name in zip(values.T, names or (), strict=True):
            if np.nanmin(column) != np.nanmax(column):
                continue
            axes = excited(path, test)
            hint = f"; {path.name} excites {', '.join(axes)}, expected a log of the same joint" if axes else ""
            if side == "input" and np.nanmin(column) != 0.0:
                hint += FROM_REST
            raise ScenarioError(
                f"{path.name}: the {side} {name!r} is constant at {np.nanmin(column):g}; expected one "
                f"that moves in {len(values)} samples{hint}"
            )


def _remarks(fitted: FittedModel, *, judged_on_own_records: bool) -> tuple[str, ...]:
    """Remarks on gaps, missing samples, dependent inputs and bandwidths, and the estimator's own warnings."""
    records = fitted.parts
    remarks = []
    if len(records) > 1:
        subject = "the model and the fits are" if judged_on_own_records else "the model is"
        remarks.append(
            f"{subject} of {len(records)} parts between lost samples or of several files, "
            f"{sum(map(len, records))} samples in all"
        )
    missing, samples = sum(int((~record.known).sum()) for record in records), sum(record.y.size for record in records)
    if missing:
        remarks.append(f"{missing} of {samples} output samples are missing")
    if dependent := dependent_inputs(records):
        remarks.append(dependent)
    remarks += _bandwidth_remarks(fitted)
    return (*remarks, *map(without_python_advice, fitted.estimate.diagnostics.get("warnings", ())))


def dependent_inputs(records: Sequence[IOData]) -> str:
    """Remark on inputs that move together, so that their effects cannot be told; empty if they do not."""
    longest = max(records, key=len)
    inputs = input_independence(longest.scored.u, longest.input_names or (), lags=LAGS)
    if inputs is None or inputs.condition <= LIMIT:
        return ""
    return (
        f"the inputs {', '.join(inputs.names)} move together (condition {inputs.condition:.3g} between them, limit "
        f"{LIMIT:g}): their effects on the outputs cannot be separated"
    )


def _bandwidth_remarks(fitted: FittedModel) -> list[str]:
    """Reasons against bandwidths with their paths; one that holds for all paths is given once."""
    first = fitted.parts[0]
    paths_of_reason: dict[str, list[str]] = {}
    for i, row in enumerate(fitted.claims):
        for j, claim in enumerate(row):
            path = f"{(first.input_names or ())[j]} → {(first.output_names or ())[i]}"
            for reason in claim.warnings:
                paths_of_reason.setdefault(reason, []).append(path)
    remarks = []
    for reason, paths in paths_of_reason.items():
        holds_for_all = len(paths) == first.nu * first.ny
        remarks.append(reason if holds_for_all else f"{', '.join(paths)}: {reason}")
    return remarks


def without_python_advice(text: str) -> str:
    """Leave out of a warning of `sysid` the advice on Python arguments, which the command line does not have."""
    return reworded(text, text.advice, {}) if isinstance(text, Message) else text


def _roots(model: Estimate) -> dict[str, object]:
    """Poles and zeros in the z plane, and of a continuous-time model in rad/s with its delays; none of a response."""
    if model.method == "impulseest":
        return {"poles": [], "zeros": []}
    if not isinstance(model, ContinuousEstimate):
        return {"poles": model.poles(), "zeros": model.zeros()}
    continuous = {"poles": model.poles(), "zeros": model.zeros(), "delays_s": model.continuous.delays}
    return {"poles": sampled_poles(model), "zeros": model.model.input_path().zeros(), "continuous": continuous}


def deviations(model: Estimate) -> FloatArray:
    """Standard deviations of the parameters (p,); NaN where they are not known."""
    # Rounding may leave a variance of nearly zero below it.
    return np.sqrt(np.maximum(np.diag(model.covariance), 0.0))


def long_lag(data: IOData | Sequence[IOData]) -> int:
    """Lags of a window that resolves a bandwidth near 1 Hz: a tenth of the samples; 30, as in MATLAB, are too few.

    Args:
        data: One experiment, or several, the shortest of which has more lags.
    """
    records = (data,) if isinstance(data, IOData) else data
    lengths = [len(record.scored) for record in records]
    return min(sum(lengths) // 10, min(lengths) - 1)


def spectral_analysis(parts: Sequence[IOData]) -> FrequencyResponse | None:
    """Frequency response by spectral analysis of the records of a fit, NaN where an input has no power of its own.

    NaN too where a single input and output are hardly coherent: it would show the disturbance. None where records are
    too short, or nothing is known.
    """
    about = subtract_means(parts)
    with suppress(SysidError), warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        response = sysid.spa(about, lag=long_lag(about))
        known = np.isfinite(response.response).all(axis=(1, 2)) & _beyond_side_lobes(response)
        known &= _every_input_has_power(about, response.frequencies)
        if response.covariance is not None:
            # spectra that leakage governs have no variance: their coherence would exceed one
            known &= np.isfinite(response.covariance).all(axis=(1, 2, 3, 4))
        # of several channels the coherence tells no single path apart
        if response.coherence is not None and response.coherence[0].size == 1:
            known &= response.coherence[:, 0, 0] > COHERENT
        if known.any():
            # a line that ends where nothing is known, and does not bridge it
            return replace(response, response=np.where(known[:, None, None], response.response, np.nan))
    return None


def _every_input_has_power(parts: Sequence[IOData], frequencies: FloatArray) -> NDArray[np.bool_]:
    """Whether each input has power of its own, not leaked from elsewhere, at each frequency (K,), in any record."""
    has_power = np.zeros((len(frequencies), parts[0].nu), dtype=bool)
    for part in parts:
        for j, u in enumerate(part.scored.u.T):
            own = not_leakage(hann_power(u))
            lines = np.rint(frequencies * len(u) * part.dt).astype(int)
            has_power[:, j] |= own[np.minimum(lines, len(own) - 1)]
    return np.asarray(has_power.all(axis=1))


def _beyond_side_lobes(response: FrequencyResponse) -> NDArray[np.bool_]:
    """Whether each input has more power than the window leaks from its strongest line, at each frequency (K,)."""
    if response.input_spectrum is None:
        raise MissingRecordError(f"the response by {response.method} has no input spectrum")
    power = np.einsum("fjj->fj", response.input_spectrum).real
    return np.asarray((power > SIDE_LOBES * power.max(axis=0)).all(axis=1))


def figures(result: Identification) -> Mapping[str, "Figure"]:
    """Draw a model and the records behind it.

    Returns:
        Figures by name: `record`, `outputs`, `bode`, `step`, `roots`, and `residuals` where they could be tested.
    """
    from sysid import plots

    model, checked, error = result.fitted.estimate, result.checked, result.error
    longest = max(range(len(checked)), key=lambda k: len(checked[k]))
    fit = result.fit.by_experiment[longest] if result.fit.by_experiment else result.fit
    record, parts = checked[longest], result.fitted.parts
    if result.fitted.integrates.any():
        # an integrator has no level to be about: the values of the record
        level = 0.0 if record.output_offset is None else record.output_offset
        fit = replace(fit, simulated=fit.simulated + level)
        record, parts = record.retrend(), tuple(part.retrend() for part in parts)
    nonparametric = None if result.fitted.integrates.any() else spectral_analysis(parts)
    responses = [model] if nonparametric is None else [nonparametric, model]
    outputs, times = plots.output_comparison(record, fit), record.time
    if len(times) > DRAWN:
        # A whole long record would be a band in which nothing is seen.
        outputs.axes[0].set_xlim(times[0], times[DRAWN])
    drawings = {
        "record": plots.record(parts),
        "outputs": outputs,
        "bode": plots.bode(responses, error=error if error is not None and error.is_wider.any() else None),
        "step": plots.step(model),
        "roots": plots.pzmap(model),
    }
    if result.test is not None:
        drawings["residuals"] = plots.correlations(result.test, plots.PALETTE.get(model.method, plots.PALETTE["oe"]))
    return drawings

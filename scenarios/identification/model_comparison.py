"""Comparison of models of any origin on one record: the truth, printed models, estimates, and model files."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import sysid
from scenarios.files.result_table import ResultTable
from scenarios.identification.identification import Identification, drifts, identify, relative_to_measured, usable
from scenarios.identification.named_models import KnownModel, ModelName, known_models
from scenarios.identification.result_tables import LARGEST_DECIMAL, SMALLEST_DECIMAL, ends_in_words
from sysid import Estimate, FrequencyResponse, IOData, ModelFit, StateSpace
from sysid.models.bandwidth import HALF_POWER, gain_crossing
from sysid.models.model_forms import as_model
from sysid.models.predict import aligned, channels_in
from sysid.models.static_gain import gain_told_by
from sysid.polynomial.fit_with_offset import subtract_means, unexplained_lines, unexplained_offset
from sysid.validation.compare import OWN_DATA, is_training
from sysid.validation.model_error import ModelError
from sysid.validation.own_line import has_line

DRIFTS = "beside its response to the input the output follows a straight line: --trend judges all models beside one"

BESIDE_LINE = "judged beside a straight line in the output"

INTEGRATES = 1e-9
"""Distance of a pole from one, up to which it integrates."""

BESIDE_ONE = 1e-5
"""Distance of a pole from one up to which a table calls it an integrator's: estimates of one lie on either side."""

LOW = 0.1
"""Frequency, Hz, below which three decimals are too few."""


@dataclass(frozen=True, eq=False)
class JudgedModel:
    """A model on a record.

    Attributes:
        label: Text for tables and legends.
        kind: `truth`, `published`, `file` or the method of an estimator.
        model: The model.
        fit: Its fits, about its own operating point.
        trends: What every output of each record has about its mean beside the model: a constant or a straight line
            (N_i, ny).
        bandwidth_hz: Bandwidth of every path (ny, nu), Hz; NaN where there is none, or none that can be claimed.
        ci95: Ends of their 95 % intervals (ny, nu, 2), Hz; NaN where they are not known.
        remarks: Remarks on the model.
        identification: How it was identified; None for a model that was known beforehand.
        error: Gains with intervals for the best linear system, on the records of its fit; None where not measured.
    """

    label: str
    kind: str
    model: StateSpace
    fit: ModelFit
    trends: tuple[NDArray[np.float64], ...]
    bandwidth_hz: NDArray[np.float64]
    ci95: NDArray[np.float64]
    remarks: tuple[str, ...]
    identification: Identification | None = None
    error: ModelError | None = None

    @property
    def item(self) -> Estimate | StateSpace:
        """The estimate, drawn with its intervals in figures of responses and poles, or a model without intervals."""
        return self.model.input_path() if self.identification is None else self.identification.fitted.estimate

    @property
    def level(self) -> NDArray[np.float64]:
        """Constant on every output between the mean and the operating point of the model (ny,)."""
        return np.asarray(np.concatenate(self.trends).mean(axis=0))

    def bandwidth_cells(self, output: int, input: int) -> tuple[str, str]:
        """Return bandwidth and 95 % interval of a path as texts; a dash or nothing where there is none."""
        hz, (low, high) = self.bandwidth_hz[output, input], self.ci95[output, input]
        # of an integrator neither means anything
        if not np.isfinite(hz) or np.isnan(self.gain[output, input]):
            return "—", ""
        interval = f"{_hz_text(low)} to {_hz_text(high)}" if np.isfinite(low) else ""
        return _hz_text(hz), interval

    def distorted_cell(self, output: int, input: int) -> str:
        """95 % interval of the bandwidth of a path with distortion and order, or why an estimate has none."""
        if not np.isfinite(self.bandwidth_hz[output, input]):
            return ""
        if self.error is None:
            # a saved estimate is judged by records, but knows nothing of those that it was fitted to
            is_estimate = np.isfinite(self.ci95[output, input]).all()
            return "needs the record of its fit" if is_estimate and self.identification is None else ""
        return ends_in_words(self.error.bandwidth(), output, input)

    @property
    def gain(self) -> NDArray[np.float64]:
        """Gain at 0 Hz of every path (ny, nu), NaN of those that integrate for a record of this length."""
        return gain_told_by(self.model, self.model.dt, len(self.fit.simulated))

    def record(self) -> dict[str, object]:
        """Return what `hmtb compare --json` prints of it; of a single path numbers, else rows of outputs."""
        is_single_path = self.model.nu == self.model.ny == 1
        paths = {"bandwidth_hz": self.bandwidth_hz, "ci95": self.ci95}
        if self.error is not None:
            paths["ci95_with_distortion_and_order"] = np.stack(self.error.bandwidth().ci95, axis=-1)
        paths["dc_gain"] = self.gain
        if is_single_path:
            paths = {name: values[0, 0] for name, values in paths.items()}
        half_power_hz = self._half_power_hz()
        return {
            "model": self.label,
            "kind": self.kind,
            "fit": {name: getattr(self.fit, name) for name in ("simulation", "one_step", "steps", "ahead")},
            **paths,
            "half_power_hz": half_power_hz[0] if is_single_path else half_power_hz,
            "poles": self.model.input_path().poles(),
            "stable": self.model.is_stable(),
            "operating_point": self.level,
            "remarks": self.remarks,
        }

    def _half_power_hz(self) -> list[float]:
        """Frequency of the gain 0.707 from each input to its own output, Hz; NaN where the gain starts below it."""
        model = self.model
        # Half a cycle per sample is the highest frequency there is.
        frequencies = np.geomspace(1e-4, 0.5, 4000) / model.dt
        response = model.frequency_response(frequencies)
        crossings = []
        for k in range(min(model.ny, model.nu)):
            path = FrequencyResponse(frequencies, response[:, k : k + 1, k : k + 1], model.dt, "model")
            crossings.append(gain_crossing(path, HALF_POWER))
        return crossings


def compare_models(
    names: Sequence[ModelName],
    records: Sequence[IOData],
    path: Path,
    *,
    estimation: Sequence[IOData] | None = None,
    estimation_path: Path | None = None,
    skip: float = 0.0,
    keep_mean: bool = False,
    trend: Mapping[str, bool] | None = None,
    steps: int = 1,
    test: str | None = None,
) -> tuple[tuple[IOData, ...], tuple[JudgedModel, ...]]:
    """Judge models on a record, each about its own operating point.

    Args:
        names: The models.
        records: The record, as read.
        path: Its file: the truth is that of the log's arm.
        estimation: Records that estimators identify from; the same records when None.
        estimation_path: Their file.
        skip: Length of the start that is left out of both, s.
        keep_mean: Whether models are of the values as they are, without an operating point.
        trend: Options of estimators for a constant or a straight line in the output, as in `identify`; models that are
            known beforehand are judged beside a line too.
        steps: Horizon of the further prediction, samples.
        test: Which test of the file, for messages.

    Returns:
        The record about its means, or as it is; and the models with their fits, in the sequence of their names.

    Raises:
        ScenarioError: A model does not go with the record: other joints, another sampling interval, no truth known.
        SysidError: An estimator refuses the records.
    """
    judging = usable(records, skip, path, test)
    about_means = tuple(judging) if keep_mean else subtract_means(judging)
    models: list[JudgedModel] = []
    for name in names:
        if name.is_estimated:
            source = usable(estimation or records, skip, estimation_path or path, test)
            result = identify(
                source, name.kind, name.orders, keep_mean=keep_mean, trend=trend, steps=steps, check=judging
            )
            models.append(judged_identification(result, about_means))
        else:
            for known in known_models(name, judging[0], path):
                line = bool(trend and trend.get("trend"))
                models.append(judged_known(known, name.kind, about_means, keep_mean=keep_mean, line=line, steps=steps))
    are_beside_lines = all(BESIDE_LINE in "".join(model.remarks) for model in models)
    if not trend and not keep_mean and not are_beside_lines and drifts(about_means):
        warnings.warn(DRIFTS, sysid.SysidWarning, stacklevel=2)
    return about_means, tuple(models)


def judged_identification(result: Identification, about_means: Sequence[IOData]) -> JudgedModel:
    """Return an identified model for a comparison on the records that judge it.

    Args:
        result: The model and how it was judged.
        about_means: The judging records about their means; as they are where the model has no operating point.
    """
    fitted = result.fitted
    method = fitted.estimate.method
    label = f"{method.upper()} {'/'.join(map(str, fitted.orders.values()))}"
    # The same samples twice, about their means and about the model's own operating point.
    differences = [record.y - checked.y for record, checked in zip(about_means, result.checked, strict=True)]
    claims = np.array([[(claim.hz, claim.low, claim.high) for claim in row] for row in fitted.claims])
    return JudgedModel(
        label=label,
        kind=method,
        model=fitted.estimate.model,
        fit=replace(result.fit, name=label),
        trends=tuple(map(_without_gaps, differences)),
        bandwidth_hz=claims[..., 0],
        ci95=claims[..., 1:],
        remarks=result.warnings,
        identification=result,
        error=result.error,
    )


def records_about_means(result: Identification) -> Sequence[IOData]:
    """Return the records that judge a model about their means; as they are where it has no operating point."""
    if result.fitted.estimate.operating_point is None:
        return result.checked
    return subtract_means([record.retrend() for record in result.checked])


def _without_gaps(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """A constant or a straight line of every output (N, ny) at missing samples too."""
    samples = np.arange(len(line))
    filled = np.empty_like(line)
    for i, column in enumerate(line.T):
        known = np.flatnonzero(np.isfinite(column))
        first, last = known[0], known[-1]
        slope = (column[last] - column[first]) / max(last - first, 1)
        filled[:, i] = column[first] + slope * (samples - first)
    return filled


def judged_known(
    known: KnownModel, kind: str, about_means: Sequence[IOData], *, keep_mean: bool, line: bool, steps: int
) -> JudgedModel:
    """Judge a model that is known about the operating point that records and its dynamics tell.

    Args:
        known: The model: of any origin, or estimated from these or other records.
        kind: `truth`, `published`, `file` or the method of an estimator.
        about_means: The records about their means; as they are with `keep_mean`.
        keep_mean: Whether the model is of the values as they are, without an operating point.
        line: Whether it is judged beside a straight line in the output in any case.
        steps: Horizon of the further prediction, samples.

    Raises:
        SysidError: Other channels or another sampling interval than those of the records.
    """
    record, model = about_means[0], as_model(known.model)
    why = _why_beside_a_line(known.model, asked=line)
    if keep_mean:
        trends = tuple(np.zeros_like(part.y) for part in about_means)
    elif why:
        trends = unexplained_lines(model, about_means)
    else:
        level = unexplained_offset(model, about_means)[0]
        trends = tuple(np.broadcast_to(level, part.y.shape) for part in about_means)
    checked = tuple(part.subtract(y=trend) for part, trend in zip(about_means, trends, strict=True))
    remarks = known.remarks if keep_mean or not why else (*known.remarks, why)
    # An estimate knows the record that it is from, of which its matrices alone tell nothing.
    (fit,) = sysid.compare({known.label: known.model}, checked, steps=steps)
    fit = relative_to_measured(fit, checked, about_means)
    if not fit.is_training and is_training(known.model, about_means):
        # without their lines the records are others
        fit = replace(fit, is_training=True)
        warnings.warn(f"{known.label}: {OWN_DATA}, so that the fit is no validation", sysid.SysidWarning, stacklevel=2)
    hz = model.bandwidth()
    ci95 = np.full((*hz.shape, 2), np.nan)
    # A saved estimate has the covariance that intervals need; a matrix that is printed has none.
    band = known.model.bandwidth() if isinstance(known.model, Estimate) else None
    if band is not None:
        hz, ci95 = band.hz, np.stack(band.ci95, axis=-1)
    # Channels in the sequence of the record's, which may be another one.
    inputs, outputs = channels_in(model, record)
    paths = np.ix_(outputs, inputs)
    return JudgedModel(
        label=known.label,
        kind=kind,
        model=aligned(model, record),
        fit=fit,
        trends=trends,
        bandwidth_hz=hz[paths],
        ci95=ci95[paths],
        remarks=remarks,
    )


def _why_beside_a_line(model: Estimate | StateSpace, *, asked: bool) -> str:
    """Why a known model is judged beside a straight line of the record's own, in words; empty if it is not."""
    if asked:
        return BESIDE_LINE
    if isinstance(model, Estimate) and has_line(model):
        return f"{BESIDE_LINE}, as it was identified"
    # A constant in the input of an integrator is a line in its output.
    poles = as_model(model).input_path().poles()
    if (np.abs(poles - 1.0) < INTEGRATES).any():
        return f"{BESIDE_LINE}: it integrates, and the operating point of its input is not known"
    return ""


def comparison_table(models: Sequence[JudgedModel], outputs: Sequence[str], title: str) -> ResultTable:
    """Table of fits, bandwidths, gains and stability, a row for every model and output."""
    steps, has_several_outputs = models[0].fit.steps, len(outputs) > 1
    columns = ["model", "simulation %", "one step %"]
    if has_several_outputs:
        columns.insert(1, "output")
    if steps > 1:
        columns.append(f"{steps} steps %")
    # The truth and printed models have no record of a fit to measure errors on.
    has_errors = any(judged.error is not None for judged in models)
    columns += ["bandwidth Hz", "95 % of parameters"]
    if has_errors:
        columns.append("with distortion and order")
    columns += ["gain at 0 Hz", "stable"]
    rows = []
    for judged in models:
        gain, fit = judged.gain, judged.fit
        stable = "yes" if judged.model.is_stable() else "NO"
        # Estimates of a pole at one lie inside or outside: neither says that the plant is stable or not.
        poles = judged.model.input_path().poles()
        if np.isnan(gain).any() and (np.abs(poles - 1.0) < BESIDE_ONE).any() and np.abs(poles).max() < 1.0 + BESIDE_ONE:
            stable = "integrates"
        for i, output in enumerate(outputs):
            row = [judged.label if i == 0 else ""]
            if has_several_outputs:
                row.append(output)
            row += [f"{fit.simulation[i]:.2f}", f"{fit.one_step[i]:.2f}"]
            if steps > 1:
                row.append(f"{fit.ahead[i]:.2f}")
            # Each output with its own input: of joints, the coupling is not shown.
            k = min(i, judged.model.nu - 1)
            row += judged.bandwidth_cells(i, k)
            if has_errors:
                row.append(judged.distorted_cell(i, k))
            row.append("—" if np.isnan(gain[i, k]) else _gain_text(gain[i, k]))
            rows.append((*row, stable))
    return ResultTable(title, tuple(columns), tuple(rows))


def _hz_text(hz: float) -> str:
    """A frequency with three decimals, or with four digits where it is so low that these would show none."""
    return f"{hz:.3f}" if hz >= LOW else f"{hz:.4g}"


def _gain_text(gain: float) -> str:
    """A gain with three decimals, or with four digits where its units make it very small or large."""
    if gain == 0.0 or SMALLEST_DECIMAL <= abs(gain) < LARGEST_DECIMAL:
        return f"{gain:.3f}"
    return f"{gain:.4g}"

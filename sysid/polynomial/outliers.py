"""A test for outliers among the residuals of a fit, which names their samples."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.polynomial.correlation import COLOUR, ERRORS_PER_COEFFICIENT, autoregression
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import Message

FALSE_ALARMS = 0.005  # share of records with normal errors that are reported; 0.01 is promised
NORMAL_MEDIAN = float(scipy.special.ndtri(0.75))  # median of |x| of a standard normal variable
MEDIAN_SPREAD = 1.17  # standard deviation of the median of |x|, relative to it, times the root of the samples
SURE = 2.5  # standard deviations by which the scale of few samples may be too small
CLIPPED = 3.0  # robust deviations beyond which errors do not count for the colour
FEWEST = 30  # samples: fewer give no scale
FAR = 50.0  # robust standard deviations beyond which an outlier spoils tests of the other residuals
FAR_OUTLIERS = "far-outliers"  # code of the message on such ones
NAMED = 5  # samples that a message names, the largest
EXACT = 1e-8  # scale, relative to the deviation of the output, below which errors are those of rounding or of a model

ADVICE = (
    "; y = NaN with missing=True leaves wrong samples out, error_threshold=1.6 of arx, oe, armax, bj and polyest lets "
    "large errors count linearly"
)


def outlier_messages(
    errors: Sequence[FloatArray], experiments: Sequence[IOData], *, count_linearly: bool = False
) -> list[str]:
    """Describe residuals that normal errors of their robust scale do not have.

    The errors are whitened by an autoregressive model of their clipped values. Their scale is the median of their
    absolute values over 0.6745 [Huber1981, ch. 5]. The threshold is the quantile that the largest of as many normal
    values exceeds in 0.5 % of records, raised for short records, whose scale is itself uncertain.

    Args:
        errors: One-step errors of an output (N_i,) of each experiment, NaN where the output is missing.
        experiments: The data, as many.
        count_linearly: Whether the fit lets large errors count linearly already.

    Returns:
        No message, or one.
    """
    whitened = _whitened(errors, experiments)
    known = np.concatenate([np.abs(values[np.isfinite(values)]) for values in whitened])
    count = len(known)
    if count < FEWEST:
        return []
    scale = float(np.median(known)) / NORMAL_MEDIAN
    largest_deviation = max(float(np.nanstd(e.y)) for e in experiments)
    if scale <= EXACT * largest_deviation:
        return []
    limit = outlier_limit(count)
    places = [np.flatnonzero(np.abs(np.nan_to_num(values)) > limit * scale) for values in whitened]
    total = sum(map(len, places))
    if not total:
        return []
    return [_message(whitened, experiments, places, limit, scale, count, count_linearly)]


def outlier_limit(count: int) -> float:
    """Robust deviations that the largest of `count` normal errors exceeds in 0.5 % of records at most."""
    of_largest = -float(scipy.special.ndtri(FALSE_ALARMS / (2.0 * count)))
    return of_largest / (1.0 - min(SURE * MEDIAN_SPREAD / np.sqrt(count), 0.6))


def _whitened(errors: Sequence[FloatArray], experiments: Sequence[IOData]) -> list[FloatArray]:
    """Errors (N_i,) filtered by an autoregressive model of them; NaN where one of its samples is missing."""
    counted = []
    for of_record, experiment in zip(errors, experiments, strict=True):
        counted.append(np.where(np.arange(len(of_record)) < experiment.window, np.nan, of_record))
    joined = np.concatenate(counted)
    known = np.isfinite(joined)
    order = min(COLOUR, int(known.sum()) // ERRORS_PER_COEFFICIENT)
    if not order:
        return counted
    limit = CLIPPED * float(np.median(np.abs(joined[known]))) / NORMAL_MEDIAN
    # values that are all equal have no colour
    if not limit > 0.0:
        return counted
    whitener, _ = autoregression(np.clip(joined, -limit, limit), order, select=True)
    filtered = []
    for of_record in counted:
        values = scipy.signal.lfilter(whitener, [1.0], of_record)
        values[: len(whitener) - 1] = np.nan
        filtered.append(values)
    return filtered


def _message(
    whitened: Sequence[FloatArray],
    experiments: Sequence[IOData],
    places: Sequence[NDArray[np.intp]],
    limit: float,
    scale: float,
    count: int,
    count_linearly: bool,
) -> str:
    """Message that names the largest outliers, in order of time."""
    sizes = []
    for k, (values, of_record) in enumerate(zip(whitened, places, strict=True)):
        for sample in of_record.tolist():
            sizes.append((abs(float(values[sample])) / scale, k, sample))
    named = sorted(sorted(sizes, reverse=True)[:NAMED], key=lambda outlier: outlier[1:])
    texts = []
    for size, k, sample in named:
        experiment = experiments[k]
        where = f" of experiment {experiment.name or k + 1}" if len(experiments) > 1 else ""
        texts.append(f"{experiment.time[sample]:.6g} s (sample {sample}{where}, {size:.3g} deviations)")
    largest = "the largest at" if len(sizes) > NAMED else "at"
    effect, advice = "pull the parameters", ADVICE
    if count_linearly:
        effect, advice = "count linearly, by error_threshold", ""
    text = (
        f"{len(sizes)} of {count} residuals are outliers, beyond {limit:.3g} robust standard deviations, and {effect}: "
        f"{largest} {', '.join(texts)}; look whether these samples are wrong, or show what the model lacks{advice}"
    )
    code = FAR_OUTLIERS if max(sizes)[0] > FAR else "outliers"
    return Message(text, code, error_threshold=advice)

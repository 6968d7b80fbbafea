"""Spectra, coherence and frequency response by averaging over overlapping segments."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from sysid.frequency.spectra import response_of_spectra
from sysid.frequency.unclaimed_errors import smoothing_messages
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.data_checks import check_excitation, large_means
from sysid.records.arguments import real_number, whole_number, window_values
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, warn_each


def welch(
    data: IOData | Sequence[IOData],
    *,
    segment: int | None = None,
    overlap: float = 0.5,
    window: Callable[[int], FloatArray] = np.hanning,
) -> FrequencyResponse:
    """Average periodograms of windowed segments [Welch1967].

    Phi_xz(f) = dt / sum(w^2) * mean over segments of X conj(Z), X the transform of w x. Response, disturbance and
    coherence follow as in `spa`. Detrend first. Initialisation windows are omitted; segments do not cross the boundary
    of an experiment.

    Args:
        data: One experiment, or several; any numbers of inputs and outputs, as in `spa`.
        segment: Length of a segment; by default an eighth of the shortest experiment.
        overlap: Share of a segment in common with the next one, 0 <= overlap < 1.
        window: Data window: `segment` values, e.g. `np.hanning`, `np.ones`.

    Returns:
        Response with covariance, coherence, and the four spectra (two-sided, unit^2/Hz) at k / (segment dt), k >= 1.
        The covariance accounts for the overlap of segments.

    Warns:
        SysidWarning: Means that dominate, inputs that depend on each other, no frequency at which they have power; a
            response that changes within the width of the smoothing.

    Raises:
        SysidError: Constant input, segment or overlap out of range, an invalid window, not more segments than
            inputs.
    """
    experiments = tuple(e.scored for e in as_experiments(data, series=True))
    warn_each(check_excitation(experiments, [0] * experiments[0].nu) + large_means(experiments))
    shortest = min(len(e) for e in experiments)
    if shortest < 4:
        raise SysidError(f"too few samples: {shortest} behind the initialisation window, at least 4 are needed")
    default_length = max(shortest // 8, 4)
    length = whole_number("segment", default_length if segment is None else segment, 4, shortest)
    overlap = real_number("overlap", overlap, "be at least 0 and less than 1", lambda share: 0.0 <= share < 1.0)
    w = window_values(window, length)
    if not w.any():
        raise SysidError(f"window({length}) must not be zero throughout")
    # an overlap close to one still moves on by a sample
    hop = max(1, round(length * (1.0 - overlap)))
    count, channels = length // 2, experiments[0].nu + experiments[0].ny
    phi: ComplexArray = np.zeros((count, channels, channels), dtype=complex)
    counts = [(len(e) - length) // hop + 1 for e in experiments]
    for e, segments in zip(experiments, counts, strict=True):
        v = np.hstack((e.u, e.y))
        for k in range(segments):
            windowed = w[:, None] * v[k * hop : k * hop + length]
            # without 0 Hz, which holds the mean
            transform = scipy.fft.rfft(windowed, axis=0)[1 : count + 1]
            phi += transform[:, :, None] * transform[:, None, :].conj()
    dt = experiments[0].dt
    phi *= dt / float(w @ w) / sum(counts)
    averages = sum(_independent(w, hop, segments) for segments in counts)
    f = scipy.fft.rfftfreq(length, dt)[1:]
    response = response_of_spectra("welch", experiments, f, phi, averages=averages)
    warn_each(smoothing_messages(experiments, response, "use longer segments"))
    return response


def _independent(w: FloatArray, hop: int, segments: int) -> float:
    """Number of independent segments with the same variance [Welch1967].

    Periodograms of segments that lie j apart have the correlation of the squared overlap of their windows.
    """
    inflation = 1.0
    for j in range(1, segments):
        if j * hop >= len(w):
            break
        overlap = float(w[j * hop :] @ w[: len(w) - j * hop]) / float(w @ w)
        inflation += 2.0 * (1.0 - j / segments) * overlap**2
    return segments / inflation

"""Frequency response by local polynomials, free of leakage."""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sysid.frequency.local_fit import SIGNIFICANT, Lines, LocalFit, tested_rows, where_in_words
from sysid.frequency.spectra import checked_frequencies
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.data_checks import check_excitation
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.repetition import LEAST_SHARE, repetitions, unrepeated_share

LARGEST_GRID = 400  # frequencies estimated at if none are given, at most
BESIDE = (-1.5, -1.0, 0.0, 1.0, 1.5)  # half widths of a window beside a frequency at which that is tested


def lpm(
    data: IOData | Sequence[IOData],
    frequencies: ArrayLike | None = None,
    *,
    degree: int = 2,
    denominator: int = 0,
    half_width: int | None = None,
    period: int | None = None,
) -> FrequencyResponse:
    """Frequency response and noise by local polynomials of response and transient [Pintelon2012, ch. 7].

    About a frequency, response and leakage are both smooth: with r the distance in lines,

        Y(k + r) = sum_s g_s r^s U(k + r) + sum_s t_s r^s + V(k + r),  s = 0..degree,

    is solved by least squares over 2 half_width + 1 lines. The transient terms take up what a record that starts in
    motion, or stops in it, adds to its transform, which `etfe` counts as response. With a `denominator` both are
    rational functions with a common one, 1 + sum_s d_s r^s, to first order in the noise [McKelvey2012]: a lightly
    damped resonance is then seen with few lines. Several experiments share the response and have transients of their
    own; they may have any lengths. Initialisation windows are omitted; there is no need to detrend.

    Args:
        data: One experiment, or several; any numbers of inputs and outputs. Several inputs that are active together
            must not be alike over the lines of a window.
        frequencies: Hz, above 0 and up to Nyquist (nf,); by default lines of the record, at most 400.
        degree: Of the polynomials.
        denominator: Degree of the denominators; 0 for polynomials.
        half_width: Lines on either side; by default as few as leave 6 equations to show the noise. Lines past 0 Hz
            or Nyquist are conjugates of those within.
        period: Samples after which the input repeats: the lines are then those of the mean over its whole periods, the
            last ones of a record. Nonlinear distortion, which repeats with the input, scatters from line to line and
            counts as noise. By default the period is found from the inputs, where all experiments have the same and it
            has lines enough; 0 takes the records as a whole.

    Returns:
        Response with covariance and noise spectrum (two-sided, unit^2/Hz); NaN where the input does not determine it.

    Raises:
        SysidError: Constant input, missing outputs, too few lines for the unknowns, a period that does not fit in.

    Warns:
        SysidWarning: No frequency at which the inputs determine the response; a given period with which the inputs do
            not repeat; a response that changes faster than polynomials follow, as beside a lightly damped resonance.
    """
    experiments = tuple(e.scored for e in as_experiments(data))
    first = experiments[0]
    degree = int(whole_number("degree", degree, 0, 10))
    denominator = int(whole_number("denominator", denominator, 0, 10))
    if half_width is not None:
        half_width = int(whole_number("half_width", half_width, 1))
    warn_each(check_excitation(experiments, [0] * first.nu))
    if period is None:
        period = _found_period(experiments, degree, denominator, half_width)
    elif period != 0:
        period = int(whole_number("period", period, 4))
        warn_each(_unlike_periods(experiments, period))
    # the mean over periods has the noise of one, divided by their number
    periods = float(np.mean([len(e) // period for e in experiments])) if period else 1.0
    if period:
        experiments = tuple(_mean_period(e, period, k) for k, e in enumerate(experiments))
    local = LocalFit(tuple(Lines.of(e) for e in experiments), degree, denominator)
    width = local.default_half_width() if half_width is None else half_width
    local.check(width)
    shortest = min(map(len, experiments))
    if frequencies is None:
        f = _default_frequencies(shortest, first.dt)
    else:
        f = checked_frequencies(frequencies, first.dt, zero=False)
    response, covariance, noise = local.solve_all(f, width)
    warn_each(_fast_changes(local, f, width, bool(period)))
    if not np.isfinite(response).any():
        warnings.warn(
            f"the inputs do not determine the response at any of the {len(f)} frequencies: they have no power there, "
            "or are alike; the response is NaN",
            SysidWarning,
            stacklevel=2,
        )
    return FrequencyResponse(
        frequencies=f,
        response=response,
        dt=first.dt,
        method="lpm",
        covariance=covariance,
        noise_spectrum=np.asarray(periods * first.dt * noise, dtype=complex),
        degrees_of_freedom=2.0 * local.spare(width),
        noise_is_corrected=True,
        resolution=np.full(len(f), (2 * width + 1) / (shortest * first.dt)),
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )


def _found_period(experiments: Sequence[IOData], degree: int, denominator: int, half_width: int | None) -> int:
    """Period that all experiments share, if its lines suffice; 0 without one."""
    groups = repetitions(experiments)
    repeating = {k for group in groups for k, _ in group.starts}
    if len({group.period for group in groups}) != 1 or len(repeating) < len(experiments):
        return 0
    period = groups[0].period
    # runs of one waveform, each played once, are no periods of a record
    if any(len(experiment) < 2 * period for experiment in experiments):
        return 0
    means = tuple(Lines.of(_mean_period(e, period, k)) for k, e in enumerate(experiments))
    local = LocalFit(means, degree, denominator)
    try:
        local.check(local.default_half_width() if half_width is None else half_width)
    except SysidError:
        return 0
    return period


def _unlike_periods(experiments: Sequence[IOData], period: int) -> list[str]:
    """Warn of experiments whose inputs differ from one period to the next by most of their power."""
    texts = []
    for k, experiment in enumerate(experiments):
        count = len(experiment) // period
        if count < 2:
            continue
        share = unrepeated_share(experiment.u, period)
        if share > 1.0 - LEAST_SHARE:
            differing = share * (count - 1) / count
            texts.append(
                f"the inputs of experiment {k} do not repeat after {period} samples: {100.0 * differing:.0f} % of "
                "their power differs between the periods, and the mean over them is no response"
            )
    return texts


def _mean_period(experiment: IOData, period: int, k: int) -> IOData:
    """Mean over the last whole periods of an experiment, number k."""
    count = len(experiment) // period
    if not count:
        raise SysidError(
            f"experiment {k} has {len(experiment)} samples behind its initialisation window, fewer than a period of "
            f"{period}"
        )
    rows = len(experiment) - count * period
    u = experiment.u[rows:].reshape(count, period, -1).mean(axis=0)
    y = experiment.y[rows:].reshape(count, period, -1).mean(axis=0)
    return IOData(u, y, experiment.dt, input_names=experiment.input_names, output_names=experiment.output_names)


def _default_frequencies(samples: int, dt: float) -> FloatArray:
    """Lines of a record, all of a short one, else equally far apart on a logarithmic scale."""
    lines = np.arange(1, (samples + 1) // 2)
    if len(lines) > LARGEST_GRID:
        lines = np.unique(np.round(np.geomspace(1, lines[-1], LARGEST_GRID)).astype(int))
    return np.asarray(lines / (samples * dt))


def _fast_changes(local: LocalFit, f: FloatArray, width: int, repeats: bool) -> list[str]:
    """Warn of frequencies at which the response changes faster than the polynomials can follow."""
    if local.denominator:
        return []
    asked = f[tested_rows(len(f))]
    lines = local.records[0].frequencies
    # a window that has the resonance at its end shows more of it than one about it
    apart = width * float(lines[1] - lines[0]) * np.array(BESIDE)
    centres = np.unique(asked[:, None] + apart)
    # windows past an end of the spectrum are images of those within
    centres = centres[(centres >= lines[0]) & (centres <= lines[-1])]
    p_values = np.array([local.p_of_polynomials(float(centre), width) for centre in centres])
    least = p_values < SIGNIFICANT / len(centres)
    near = np.abs(asked[:, None] - centres) <= 1.01 * apart.max()
    fast = asked[(near & least).any(axis=1)]
    if not len(fast):
        return []
    without_smoothing = "; `bla` of whole periods does not smooth over lines" if repeats else ""
    return [
        f"the response changes faster {where_in_words(fast)} than polynomials over {2 * width + 1} lines follow, as "
        "beside a lightly damped resonance: its values there may be wrong by more than their deviations say; "
        f"denominator=2 follows it, and a longer record or period has closer lines{without_smoothing}"
    ]

"""Choice of the length of an impulse response and of its prior."""

import warnings
from collections.abc import Sequence

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial import impulseest
from sysid.polynomial.regularisation import Kernel
from sysid.records.arguments import whole_number
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidWarning
from sysid.selection.auto import StructureChoice
from sysid.selection.structure_search import Candidate

SHORTEST = 70
"""Coefficients at the beginning, as `impulseest` has them."""

DECAYED = 0.01
"""Size of the last tenth of a response, relative to its largest value, up to which it has decayed."""

SHARE = 8
"""Part of the shortest record that a response may take: one in so many samples."""

KERNELS: tuple[Kernel, ...] = ("tc", "dc", "ss")
"""Priors that are compared."""


def choose_impulseest(data: IOData | Sequence[IOData], *, nk: int = 1) -> StructureChoice:
    """Choose the length and the kernel of the impulse response of `impulseest`.

    The length doubles from 70 until the response has decayed, up to an eighth of the shortest experiment; of the
    kernels that with the largest marginal likelihood is taken [ChenLjung2013].

    Args:
        data: One experiment, or several that share the response.
        nk: First lag, samples.

    Returns:
        The model with the orders n, nk and kernel, and those of the other kernels, whose `bic` is -2 times the
        logarithm of the marginal likelihood. Where the response has not decayed, `cautions` says so.

    Raises:
        SysidError: `impulseest` refuses the data.

    Warns:
        SysidWarning: What `impulseest` says about the chosen model.
    """
    experiments = as_experiments(data, missing=True)
    nk = whole_number("nk", nk, 0)
    most = max(min(map(len, experiments)) // SHARE, 1)
    n = min(SHORTEST, most)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        while 2 * n <= most and not _has_decayed(impulseest(experiments, n, nk)):
            n *= 2
        fits = [impulseest(experiments, n, nk, kernel=kernel) for kernel in KERNELS]
    candidates = []
    for kernel, fit in zip(KERNELS, fits, strict=True):
        orders = {"n": n, "nk": nk, "kernel": kernel}
        evidence = -2.0 * float(fit.diagnostics["evidence"])
        candidates.append(Candidate("impulseest", orders, len(fit.parameters), fit.loss, evidence, np.nan, 0.0))  # type: ignore[arg-type]
    ranked = sorted(candidates, key=lambda candidate: candidate.bic)
    kernel = KERNELS[candidates.index(ranked[0])]
    estimate = impulseest(experiments, n, nk, kernel=kernel)
    caution = ""
    if not _has_decayed(estimate):
        caution = f"the response has not decayed after {n} samples: an integrator, a slow mode, or too short a record"
    total = sum(map(len, experiments))
    return StructureChoice(
        estimate=estimate,
        candidates=tuple(ranked),
        delays=(),
        samples=total,
        reason=f"{ranked[0]}: the response has {n} samples, and of {len(KERNELS)} kernels this one has the largest "
        f"marginal likelihood, on {total} samples",
        cautions=(caution,) if caution else (),
    )


def _has_decayed(estimate: Estimate) -> bool:
    """Whether the last tenth of every response is small, or within its noise."""
    inputs = len(estimate.data.input_names)
    deviations = np.split(np.sqrt(np.diag(estimate.covariance)), inputs)
    for response, deviation in zip(np.split(estimate.parameters, inputs), deviations, strict=True):
        last = max(len(response) // 10, 1)
        limit = np.maximum(DECAYED * np.abs(response).max(), 2.0 * deviation[-last:])
        if (np.abs(response[-last:]) > limit).mean() > 0.2:
            return False
    return True

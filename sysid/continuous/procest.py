"""Process models from records: gain, time constants, zero and delay."""

from collections.abc import Mapping, Sequence

from numpy.typing import ArrayLike

from sysid.continuous.output_error import output_error_estimate
from sysid.continuous.structures import PathStructure, ProcessPath, per_path
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.records.data import IOData


def procest(
    data: IOData | Sequence[IOData],
    kind: str | Sequence[str] | Sequence[Sequence[str]],
    *,
    max_delay: float | None = None,
    max_iterations: int = 100,
    coloured: bool = True,
    initial_conditions: InitialConditions | str = InitialConditions.ESTIMATED,
    offset: bool = False,
    start: ArrayLike | None = None,
    fixed: Mapping[str, float] | None = None,
) -> ContinuousEstimate:
    """Fit Kp (1 + Tz s) exp(-Td s) / (s (1 + Tp1 s) (1 + Tp2 s) (1 + Tp3 s)) by maximum likelihood, as `tfest` does.

    The letters of the kind say which factors there are: "P2DZU" has two poles that may be complex, 1 + 2 Zeta Tw s +
    (Tw s)^2, a zero and a delay [MathWorks]. The poles are stable, but for that of an integrator.

    Args:
        data: One experiment, or several that share the model; missing outputs are left out.
        kind: "P", the number of time constants 0 to 3, and any of D (delay), Z (zero), I (integrator) and U (a pair of
            poles that may be complex): one for all paths, one per input, or with several outputs a row per output.
        max_delay: Limit on estimated delays in s; by default 30 samples, at most a tenth of the shortest record, and
            more where a single input shows a longer one.
        max_iterations: Limit on the steps of each search.
        coloured: Whether the covariance allows for a disturbance that is not white; see `tfest`.
        initial_conditions: "estimated", a free initial state of each experiment, or "zero", rest with zero input before
            the record: an input that is constant throughout is then a step at the first sample. With a free state the
            input before the record is unknown, and the first samples up to the delay do not count; where it moves
            there above all, as in a step test, it is taken as held at its first value before (`diagnostics`,
            "input_before") if BIC prefers that.
        offset: Whether every output of every experiment has an unknown constant beside the response of the model; it
            becomes part of `operating_point`, and the covariance allows for it. For a step test about an unknown level.
        start: Parameters near the answer (p,), in the sequence of their names, as `parameters` of an estimate of this
            structure; the search begins there alone. None finds its own starts.
        fixed: Parameters that are known, values by their names in the result, e.g. {"Kp": 2.0, "Td": 0.3}; with several
            paths the name has its path, such as "Kp[2]". They have no variance and do not count in criteria.

    Returns:
        The estimate; parameters Kp, Tp1 ... or Tw, Zeta, Tp3, then Tz and Td, times in s. Real time constants fall
        from Tp1 on. `continuous` is the model.

    Raises:
        SysidError: An unknown kind, constant input but from rest, orders or delays too large for the data, an input
            that is band-limited between samples.

    Warns:
        SysidWarning: Poor excitation, no convergence, bad conditioning, a delay at its limit, a constant input, real
            poles that coincide, a time constant whose interval reaches zero, where coverage is lost.
    """

    def structures(ny: int, nu: int) -> tuple[tuple[PathStructure, ...], ...]:
        rows = per_path("kind", kind, ny, nu)
        return tuple(tuple(map(ProcessPath, row)) for row in rows)

    return output_error_estimate(
        "procest",
        data,
        structures,
        {"kind": kind},
        max_delay=max_delay,
        max_iterations=max_iterations,
        coloured=coloured,
        initial_conditions=initial_conditions,
        offset=offset,
        start=start,
        fixed=fixed,
    )

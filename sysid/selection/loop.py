"""What a choice of structure asks about feedback first: a direct term would become the inverse of the controller."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.records.data import IOData, complete_parts
from sysid.validation.feedback import feedback_p, interchanged

INTERCHANGED = "; nothing shows that it acts on them: are input and output interchanged?"

LEVEL = 0.01  # p-value below which an input counts as fed back

HELD = 0.5
"""Share of the samples whose output differs from the one before but whose input does not, from which on no controller
computes the input from the output of the same sample."""


@dataclass(frozen=True)
class Loop:
    """Outcome of the tests for feedback.

    Attributes:
        p: Least p-value of the hypothesis that no input depends on past outputs.
        is_closed: Whether an input depends on them.
        is_at_once: Whether input and output of the same sample depend on each other, and a direct term would be that
            of a controller.
        is_exact: Whether they follow from each other without any error.
        is_direct: Whether the output depends on the input of the same sample, which no controller computes from it.
        question: Question in words whether input and output are interchanged, where only the input depends on the other
            one's past; else empty.
    """

    p: float
    is_closed: bool
    is_at_once: bool
    is_exact: bool
    is_direct: bool
    question: str = ""

    @staticmethod
    def of(experiments: Sequence[IOData], *, direct: bool) -> "Loop":
        """Test records for feedback, with the sample of the same instant and, unless a direct term is allowed, without.

        Args:
            experiments: The records, without trends in the output.
            direct: Whether a direct term is allowed, whatever the tests say.
        """
        parts = complete_parts(experiments)
        p = _least_p(parts)
        at_once = p >= LEVEL and _least_p(parts, direct=False) < LEVEL
        # whatever moves an input that is held, it is not the output of the same sample
        is_direct = at_once and (direct or _is_held(parts))
        at_once = at_once and not is_direct
        # it is exactly 1 where past and present inputs explain everything: such a direct term is no controller's
        is_exact = at_once and p == 1.0
        is_closed = p < LEVEL
        return Loop(
            p=p,
            is_closed=is_closed,
            is_at_once=at_once and not is_exact,
            is_exact=is_exact,
            is_direct=is_direct,
            question=_interchange_question(parts) if is_closed else "",
        )

    @property
    def allows_direct_term(self) -> bool:
        """Whether nothing shows that a direct term would be that of a controller."""
        return not (self.is_closed or self.is_at_once)


def _least_p(parts: Sequence[IOData], *, direct: bool = True) -> float:
    """Least p-value of the hypothesis that no input depends on past outputs; 1 where no test can tell.

    Unless `direct`, an input that depends on the output of the same sample counts as fed back.
    """
    return float(np.nan_to_num(feedback_p(parts, direct=direct), nan=1.0).min())


def _is_held(parts: Sequence[IOData]) -> bool:
    """Whether the inputs stay exactly the same from one sample to the next while the outputs change.

    A relay holds its output too, but it changes when the output crosses a level: `feedback` sees that in the past.
    """
    moved = held = 0
    for part in parts:
        outputs_move = np.diff(part.y, axis=0).any(axis=1)
        inputs_move = np.diff(part.u, axis=0).any(axis=1)
        moved += int(outputs_move.sum())
        held += int((outputs_move & ~inputs_move).sum())
    return moved > 0 and held >= HELD * moved


def _interchange_question(parts: Sequence[IOData]) -> str:
    """Question whether input and output are interchanged, where only the input depends on the other one's past."""
    if not parts or not parts[0].nu == parts[0].ny == 1:
        return ""
    return INTERCHANGED if _least_p(interchanged(parts)) > LEVEL else ""

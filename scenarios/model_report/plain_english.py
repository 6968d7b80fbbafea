"""What a model says, in plain English."""

import re
from dataclasses import dataclass

import numpy as np

from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.identification import Identification
from scenarios.identification.result_tables import ends_in_words, verdict
from sysid.models.confidence_bands import band

GRADES = {"sufficient": "yes", "undecided": "partly", "not sufficient": "not", "residuals not tested": "cannot"}
"""Beginnings of verdicts, with the class of their badge."""

WITH_ERROR = "with nonlinear distortion and too low an order"
"""Words behind an interval that is wider because noise alone does not explain the errors of the simulation."""


@dataclass(frozen=True)
class Summary:
    """Head of the report.

    Attributes:
        grade: First words of the verdict.
        badge: Class of its badge.
        reason: The rest of it.
        sentences: What the model says of every path, a sentence each.
    """

    grade: str
    badge: str
    reason: str
    sentences: tuple[str, ...]


def summary(found: FileIdentification) -> Summary:
    """Return the verdict and what the model says of every path."""
    result = found.result
    grade, badge, reason = graded(verdict(result))
    first = result.fitted.parts[0]
    sentences = []
    for i, output in enumerate(first.output_names or ()):
        for j, input in enumerate(first.input_names or ()):
            parts = [_gain_at_zero(result, i, j), *_bandwidth(result, i, j), *_from_strong_line(result, i, j)]
            sentences.append(f"{input} → {output}: {'; '.join(parts)}.")
    return Summary(grade[:1].upper() + grade[1:], badge, reason, tuple(sentences))


def graded(text: str) -> tuple[str, str, str]:
    """Split a verdict into its first words, the class of their badge, and the rest."""
    # The limit of "sufficient above 0.5 Hz: ..." is one of the first words.
    grade, reason = re.split("[:;] ", text, maxsplit=1)
    badge = next((badge for start, badge in GRADES.items() if grade.startswith(start)), "cannot")
    return grade, badge, reason


def _gain_at_zero(result: Identification, i: int, j: int) -> str:
    """Gain at 0 Hz of a path with its 95 % interval, in words."""
    gain = result.fitted.gain[i, j]
    if np.isnan(gain):
        return "it integrates, and has no gain at 0 Hz"
    text, error = f"the gain at 0 Hz is {gain:.4g}", result.error
    if error is not None and error.is_wider[i]:
        low, high = sorted(float(np.sign(gain) * end[0, i, j]) for end in error.interval)
        return text if np.isnan(low) else f"{text} (95 % interval {low:.4g} to {high:.4g} {WITH_ERROR})"
    estimate = result.fitted.estimate
    if not (np.isfinite(estimate.covariance).all() and np.isfinite(estimate.dc_gain()).all()):
        return text
    ends = band(estimate, lambda model: model.dc_gain()).ci95
    return f"{text} (95 % interval {ends[0][i, j]:.4g} to {ends[1][i, j]:.4g}{_cannot_tell(result, i)})"


def _bandwidth(result: Identification, i: int, j: int) -> list[str]:
    """Bandwidth of a path with its 95 % interval, in words; none where it has none."""
    claim, error = result.fitted.claims[i][j], result.error
    if not np.isfinite(claim.hz):
        return []
    text = f"it follows up to {claim.hz:.3g} Hz (-3 dB)"
    if error is not None and error.is_wider[i]:
        return [f"{text}, 95 % interval {ends_in_words(error.bandwidth(), i, j)} {WITH_ERROR}"]
    if np.isfinite(claim.low):
        text += f", 95 % interval {claim.low:.3g} to {claim.high:.3g} Hz{_cannot_tell(result, i)}"
    return [text]


def _from_strong_line(result: Identification, i: int, j: int) -> list[str]:
    """Gain at the lowest strong line, and where it has fallen by 3 dB, where errors make the interval wider."""
    error = result.error
    if error is None or not error.is_wider[i]:
        return []
    line = error.strong_line
    row = int(np.searchsorted(error.frequencies, line))
    low, high = (float(end[row, i, j]) for end in error.interval)
    if np.isnan(low):
        return []
    text = f"from the lowest strong line of the input on: gain {error.gain[row, i, j]:.3g} ({low:.3g} to {high:.3g})"
    text += f" at {line:.3g} Hz"
    drop = error.bandwidth(line)
    hz = float(drop.hz[i, j])
    if np.isfinite(hz):
        text += f", 3 dB less at {hz:.3g} Hz ({ends_in_words(drop, i, j)})"
    return [text]


def _cannot_tell(result: Identification, i: int) -> str:
    """What an interval leaves out of which the record tells nothing."""
    error = result.error
    return " from noise alone" if error is not None and np.isnan(error.p_values[i]) else ""

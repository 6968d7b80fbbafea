"""What a model says, in plain English."""

import re
from dataclasses import dataclass

import numpy as np

from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.result_tables import verdict
from sysid.models.confidence_bands import band

GRADES = {"sufficient": "yes", "undecided": "partly", "not sufficient": "not", "residuals not tested": "cannot"}
"""Beginnings of verdicts, with the class of their badge."""


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
    text = verdict(found.result)
    grade, badge, reason = graded(text)
    fitted = found.result.fitted
    first = fitted.parts[0]
    gains = _gains(found)
    sentences = []
    for i, output in enumerate(first.output_names or ()):
        for j, input in enumerate(first.input_names or ()):
            claim = fitted.claims[i][j]
            sentence = f"{input} → {output}: {gains[i][j]}"
            if np.isfinite(claim.hz):
                sentence += f"; it follows up to {claim.hz:.3g} Hz (-3 dB)"
            if np.isfinite(claim.low):
                sentence += f", 95 % interval {claim.low:.3g} to {claim.high:.3g} Hz"
            sentences.append(f"{sentence}.")
    return Summary(grade[:1].upper() + grade[1:], badge, reason, tuple(sentences))


def graded(text: str) -> tuple[str, str, str]:
    """Split a verdict into its first words, the class of their badge, and the rest."""
    # The limit of "sufficient above 0.5 Hz: ..." is one of the first words.
    grade, reason = re.split("[:;] ", text, maxsplit=1)
    badge = next((badge for start, badge in GRADES.items() if grade.startswith(start)), "cannot")
    return grade, badge, reason


def _gains(found: FileIdentification) -> list[list[str]]:
    """Gain at 0 Hz of every path with its 95 % interval, in words."""
    estimate = found.result.fitted.estimate
    gain = found.result.fitted.gain
    low = high = np.full(gain.shape, np.nan)
    if np.isfinite(estimate.covariance).all() and np.isfinite(estimate.dc_gain()).all():
        low, high = band(estimate, lambda model: model.dc_gain()).ci95
    rows = []
    for i in range(len(gain)):
        row = []
        for j in range(gain.shape[1]):
            if np.isnan(gain[i, j]):
                row.append("it integrates, and has no gain at 0 Hz")
                continue
            interval = f" (95 % interval {low[i, j]:.4g} to {high[i, j]:.4g})" if np.isfinite(low[i, j]) else ""
            row.append(f"the gain at 0 Hz is {gain[i, j]:.4g}{interval}")
        rows.append(row)
    return rows

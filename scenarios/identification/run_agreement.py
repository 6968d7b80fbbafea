"""Agreement of several runs: a model of all of them holds only if they have one response to the input."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sysid import Estimate, IOData, SysidError
from sysid.polynomial.fit_with_offset import runs
from sysid.records.arrays import FloatArray
from sysid.validation.homogeneity import HomogeneityTest, homogeneity

MATERIAL = 0.05
"""Difference between responses of runs, relative to the response, from which on one model of all is none of theirs.

Without noise any difference is significant, also that of a rounding or of a slight nonlinearity.
"""


@dataclass(frozen=True, eq=False)
class RunAgreement:
    """Whether several runs agree, and the gain of each.

    Attributes:
        test: Test of homogeneity.
        gains: Gain at 0 Hz of a model of each run alone (K, ny, nu); NaN where the runs agree or a run has no model.
    """

    test: HomogeneityTest
    gains: FloatArray

    @property
    def agree(self) -> bool:
        """Whether no difference between the runs is both significant and large enough to matter."""
        return self.test.agree or not float(np.nanmax(self.test.differences)) >= MATERIAL

    @property
    def words(self) -> str:
        """Why a model of all runs is not sufficient; empty where they agree."""
        if self.agree:
            return ""
        words = f"the runs do not have one response to the input (p = {self.test.p_value:.2g})"
        if self.test.deviating:
            return f"{words}; without {' and '.join(self._deviations())} the others agree; identify them apart"
        if len(self.test.runs) == 2:
            return f"{words}; of two runs neither can be told to be the odd one: a third would tell"
        return f"{words}, and no majority of them agrees; identify them apart"

    def _deviations(self) -> list[str]:
        """The runs that differ, each with its gain relative to the others."""
        others = [k for k, name in enumerate(self.test.runs) if name not in self.test.deviating]
        words = []
        for name in self.test.deviating:
            ratios = self.test.gain_ratios
            if ratios[0].size > 1 or not np.isfinite(ratios[others]).all():
                words.append(name)
                continue
            weights = 1.0 / self.test.gain_deviations[others].ravel() ** 2
            common = float(np.average(ratios[others].ravel(), weights=weights))
            ratio = float(ratios[self.test.runs.index(name)].item()) / common
            words.append(f"{name}, which has {ratio:.3g} times their gain,")
        return words

    def record(self) -> dict[str, object]:
        """Return what `hmtb identify --json` prints of it."""
        by_run = {}
        for k, name in enumerate(self.test.runs):
            by_run[name] = {
                "gain_ratio": self.test.gain_ratios[k],
                "deviation": self.test.gain_deviations[k],
                "difference": self.test.differences[k],
                "p_without": self.test.p_without[k],
                "dc_gain": self.gains[k],
            }
        return {
            "agree": self.agree,
            "p": self.test.p_value,
            "deviating": self.test.deviating,
            "untested": self.test.untested,
            "runs": by_run,
        }


def run_agreement(
    model: Estimate, parts: Sequence[IOData], fit: Callable[[Sequence[IOData]], Estimate]
) -> RunAgreement | None:
    """Test whether the runs of a model agree; None for one run.

    Args:
        model: The model of all runs.
        parts: The records about the operating points of their runs.
        fit: Estimator of a model with the same orders, for each run alone where they do not agree.
    """
    places = runs(parts)
    if len(places) < 2:
        return None
    test = homogeneity(model, parts)
    gains = np.full(test.gain_ratios.shape, np.nan)
    agreement = RunAgreement(test, gains)
    if not agreement.agree:
        for k, of_run in enumerate(places):
            try:
                gains[k] = fit([parts[place] for place in of_run]).dc_gain()
            # a run too short for a model of its own; the test needs none
            except SysidError:
                continue
    return agreement

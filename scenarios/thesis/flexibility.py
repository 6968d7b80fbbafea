"""Flexibility of a method's model: its fits to tests that it was not identified from [Morris1996, ch. IV].

The thesis lets this weigh most in its choice of a structure, and drops what is not stable.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median

from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.margin import MARGIN, ahead, said, tied

COMPARED = ("armax", "oe")
"""Methods that the thesis chooses between."""

DISMISSED = ("arx", "iv4")
"""Methods that it had dismissed before."""


@dataclass(frozen=True)
class Flexibility:
    """Fits of the methods' models of one joint to unseen tests.

    Attributes:
        fits: Median fit in simulation of each stable model, percent, by method in capitals.
        unstable: Methods whose model is unstable: what it simulates grows beyond all numbers.
        tests: How many tests there are that the models have not seen.
    """

    fits: Mapping[str, float]
    unstable: tuple[str, ...]
    tests: int

    def lead(self, one: str, other: str) -> float:
        """By how much one method fits better than another, percentage points.

        An unstable model is worse than any stable one; two unstable ones are level.
        """
        if one in self.unstable or other in self.unstable:
            apart = (other in self.unstable) - (one in self.unstable)
            return float("inf") * apart if apart else 0.0
        return self.fits[one] - self.fits[other]

    def best(self, one: str, other: str) -> bool:
        """Whether one of two methods is ahead of the other by more than a tie."""
        return ahead(self.lead(one, other))

    def words(self, one: str, other: str) -> str:
        """Compare one method with another, and say whether a dismissed method is better."""
        apart = self.lead(one, other)
        gone = [name for name in (one, other) if name in self.unstable]
        if gone:
            text = (
                f"the {' and the '.join(f'{name} model' for name in gone)} from the estimation test "
                f"{'is' if len(gone) == 1 else 'are'} unstable, which counts as worse than any stable one"
            )
        elif tied(apart):
            text = (
                f"{one} and {other} are tied on the {self.tests} tests not seen: {apart:+.2f} points, less than "
                f"{MARGIN:g}"
            )
        else:
            text = f"{one} follows the {self.tests} tests not seen {abs(apart):.2f} points "
            text += f"{'better' if apart > 0 else 'worse'} than {other}"
        above = {
            name.upper(): self.lead(name.upper(), one)
            for name in DISMISSED
            if name.upper() in self.fits and one in self.fits and self.lead(name.upper(), one) > 0
        }
        if above:
            listed = " and ".join(f"{name} by {lead:.3f} points ({said(lead)})" for name, lead in above.items())
            text += f". Above it lie, of the methods that the thesis had dismissed, {listed}"
        return text


def flexibility(study: Comparison, joint: str) -> Flexibility:
    """Lay the models of the estimation test beside the tests not seen.

    Args:
        study: The study.
        joint: Name of the joint.

    Returns:
        How each method fares.

    Raises:
        MissingRecordError: A method that the thesis compares gave no model, or nothing is left to judge on.
    """
    own = single_joint_test(study.estimation_test, joint)
    fits: dict[str, float] = {}
    unstable, tests = [], 0
    for method in (*COMPARED, *DISMISSED):
        model = study.data_sets[joint].find(own, method)
        if model is None or not model.others:
            raise MissingRecordError(f"{joint.replace('_', ' ')}: no {method.upper()} model to judge on other tests")
        tests = len(model.others)
        if model.stable:
            fits[method.upper()] = median(fit.simulation for fit in model.others.values())
        else:
            unstable.append(method.upper())
    return Flexibility(fits, tuple(unstable), tests)

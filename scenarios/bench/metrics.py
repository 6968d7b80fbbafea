"""All figures of the test bench, in the sequence in which they are told."""

from scenarios.bench.agreement import Agreement
from scenarios.bench.amplitude_split import AmplitudeSplit
from scenarios.bench.bandwidth import Bandwidth
from scenarios.bench.bias import Bias
from scenarios.bench.consistency import Consistency
from scenarios.bench.coverage import Coverage
from scenarios.bench.efficiency import Efficiency
from scenarios.bench.frequency_response import FrequencyResponse
from scenarios.bench.metric import FALSE_ALARM, FigureMaker
from scenarios.bench.noise_free_recovery import NoiseFreeRecovery
from scenarios.bench.normalised_error import NormalisedError
from scenarios.bench.reliability import Reliability
from scenarios.bench.speed import Speed
from scenarios.bench.tests_and_orders import ResidualTestsAndOrders

TEN_AND_BANDWIDTH: tuple[FigureMaker, ...] = (
    NoiseFreeRecovery(),
    Consistency(),
    Efficiency(),
    Coverage(),
    NormalisedError(),
    FrequencyResponse(),
    AmplitudeSplit(),
    Bias(),
    ResidualTestsAndOrders(),
    Agreement(),
    Bandwidth(),
)
"""Ten with a verdict, and the recovered bandwidth, which is told."""

ALL_FIGURES: tuple[FigureMaker, ...] = (*TEN_AND_BANDWIDTH, Reliability(TEN_AND_BANDWIDTH), Speed(TEN_AND_BANDWIDTH))
"""Beside them what holds for all trials."""


def false_alarm_of_each() -> float:
    """Allowed probability of a false alarm of each verdict, so that of any in a run is at most `FALSE_ALARM`."""
    return FALSE_ALARM / max(1, sum(maker.verdicts() for maker in ALL_FIGURES))

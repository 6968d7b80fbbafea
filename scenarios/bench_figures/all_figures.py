"""All figures of the test bench, in the sequence in which they are told."""

from scenarios.bench_figures.agreement import Agreement
from scenarios.bench_figures.amplitude_split import AmplitudeSplit
from scenarios.bench_figures.bandwidth import Bandwidth
from scenarios.bench_figures.bias import Bias
from scenarios.bench_figures.consistency import Consistency
from scenarios.bench_figures.coverage import Coverage
from scenarios.bench_figures.efficiency import Efficiency
from scenarios.bench_figures.figure import FALSE_ALARM, FigureMaker
from scenarios.bench_figures.frequency_response import FrequencyResponse
from scenarios.bench_figures.noise_free_recovery import NoiseFreeRecovery
from scenarios.bench_figures.normalised_error import NormalisedError
from scenarios.bench_figures.reliability import Reliability
from scenarios.bench_figures.speed import Speed
from scenarios.bench_figures.tests_and_orders import ResidualTestsAndOrders

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

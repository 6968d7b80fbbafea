"""Known delays of inputs: a model is fitted to the shifted inputs, and holds the delays afterwards."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.reduction import delayed_inputs
from sysid.models.state_space import StateSpace
from sysid.records.arguments import shown, whole_number
from sysid.records.data import IOData
from sysid.records.errors import SysidError

Delays = tuple[int, ...]
"""Delay of each input in samples (nu,)."""


@dataclass(frozen=True, eq=False)
class RealiseDelayed:
    """Pure function from parameters to the model with its delays; a class, so that estimates can be pickled.

    Attributes:
        undelayed: Function from parameters to the model of the shifted inputs.
        delays: Of each input.
    """

    undelayed: Callable[[Any], StateSpace]
    delays: Delays

    def __call__(self, theta: Any) -> StateSpace:
        """Model for parameters."""
        return delayed_inputs(self.undelayed(theta), self.delays)


def input_delays(nk: int | Sequence[int], experiments: Sequence[IOData]) -> Delays:
    """Delay of each input, from one for all or one for each.

    Raises:
        SysidError: Negative delays, another number of them, or an experiment that the longest one leaves nothing of.
    """
    nu = experiments[0].nu
    several = list(nk) if isinstance(nk, Sequence | np.ndarray) else [nk] * nu
    if len(several) != nu or (nu == 0 and nk != 0):
        raise SysidError(f"nk: expected one delay for all inputs or one for each of {nu} input(s), got {shown(nk)}")
    delays = tuple(whole_number("nk", delay, 0) for delay in several)
    shortest = min(len(experiment) for experiment in experiments)
    if max(delays, default=0) >= shortest:
        raise SysidError(
            f"nk: a delay of {max(delays)} samples leaves nothing of an experiment of {shortest}: the inputs before "
            "its beginning are not known"
        )
    return delays


def with_input_delays(
    fit: Callable[[Sequence[IOData]], Estimate], experiments: Sequence[IOData], delays: Delays
) -> Estimate:
    """Fit a model to the shifted inputs, and add the delays to it.

    Residuals are not known as long as the inputs behind them are not: NaN for the first max(delays) samples.
    """
    longest = max(delays)
    undelayed = fit([_shifted(experiment, delays) for experiment in experiments])
    realise = RealiseDelayed(undelayed.realise, delays)
    model = delayed_inputs(undelayed.model, delays)
    errors = []
    ends = np.cumsum([len(experiment) - longest for experiment in experiments])[:-1]
    for of_experiment in np.split(undelayed.residuals, ends):
        unknown = np.full((longest, model.ny), np.nan)
        errors.append(np.vstack((unknown, of_experiment)))
    return replace(
        undelayed,
        model=model,
        realise=realise,
        residuals=np.concatenate(errors),
        orders={**undelayed.orders, "nk": list(delays)},
        data=DataSummary.of(experiments),
    )


def _shifted(experiment: IOData, delays: Delays) -> IOData:
    """The experiment from the sample on at which every delayed input is known, with the inputs that act there."""
    longest, samples = max(delays), len(experiment)
    columns = []
    for j, delay in enumerate(delays):
        columns.append(experiment.u[longest - delay : samples - delay, j])
    return replace(experiment[longest:], u=np.column_stack(columns))


def delays_of(estimate: object) -> Delays | None:
    """Delays that an estimate was made with; None where it is no such estimate."""
    realise = getattr(estimate, "realise", None)
    return realise.delays if isinstance(realise, RealiseDelayed) else None


def without_delays(estimate: Estimate) -> StateSpace:
    """Model of the shifted inputs of an estimate that was made with delays."""
    return cast(RealiseDelayed, estimate.realise).undelayed(estimate.parameters)

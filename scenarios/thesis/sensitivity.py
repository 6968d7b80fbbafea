"""Sensitivity of a recovered bandwidth to the chosen order."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import sysid
from scenarios.files.errors import ScenarioError
from sysid import IOData, SysidError, SysidWarning
from sysid.models.bandwidth import half_power_hz

ORDERS = ((2, 2), (3, 3), (3, 4), (4, 3), (5, 3), (4, 4), (5, 4))
"""nb, nf of the output-error models that are compared, the sufficient one included."""


@dataclass(frozen=True)
class OrderEffect:
    """One order on the estimation data.

    Attributes:
        orders: nb, nf, nk.
        bandwidth_hz: Recovered bandwidth, Hz.
        ci95: Its 95 % interval, Hz.
        dc_gain: Gain at 0 Hz, which the bandwidth is relative to.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
        residual: Standard deviation of the residuals, output units.
    """

    orders: tuple[int, int, int]
    bandwidth_hz: float
    ci95: tuple[float, float]
    dc_gain: float
    half_power_hz: float
    residual: float


def order_effects(data: IOData, nk: int) -> tuple[OrderEffect, ...]:
    """Identify output-error models of every order in `ORDERS`.

    Args:
        data: The estimation data, prepared.
        nk: Delay, samples.

    Returns:
        One record for each order of which there is a model.

    Raises:
        ScenarioError: There is none of any.
    """
    found: list[OrderEffect] = []
    refused: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        for nb, nf in ORDERS:
            try:
                estimate = sysid.oe(data, nb, nf, nk)
                band = estimate.bandwidth()
            except SysidError as error:
                refused.append(f"{nb}, {nf}, {nk}: {error}")
                continue
            ci95 = (float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0]))
            found.append(
                OrderEffect(
                    (nb, nf, nk),
                    float(band.hz[0, 0]),
                    ci95,
                    float(estimate.model.dc_gain()[0, 0]),
                    half_power_hz(estimate.model),
                    float(np.std(estimate.residuals)),
                )
            )
    if not found:
        raise ScenarioError(f"{data.name} gives no output-error model of any order: {'; '.join(refused)}")
    return tuple(found)


def spread(effects: Sequence[OrderEffect]) -> tuple[float, float]:
    """Smallest and largest bandwidth over the orders, Hz."""
    values = [entry.bandwidth_hz for entry in effects]
    return min(values), max(values)


def half_power_spread(effects: Sequence[OrderEffect]) -> tuple[float, float]:
    """Smallest and largest frequency of the gain 0.707 over the orders, Hz."""
    values = [entry.half_power_hz for entry in effects]
    return min(values), max(values)

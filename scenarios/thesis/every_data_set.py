"""Models of the thesis' structures from every data set, to see whether the data sets agree."""

import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from statistics import median
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

import sysid
from scenarios.experiments.campaign import RPCM, SINGLE_JOINT, campaign_scenario, single_joint_test
from scenarios.experiments.model_structures import Structure, every_structure
from scenarios.experiments.registry import names
from scenarios.thesis.campaign import Campaign, plays_identified_sequence
from scenarios.thesis.estimates import Fits, estimate, fits
from scenarios.thesis.steps import NO_REPORT, Part
from sysid import IOData, StateSpace, SysidError, SysidWarning
from sysid.models.bandwidth import half_power_hz

AUDIBLE = 0.1
"""Least power of an exciting component, as a part of the strongest: below lie rounding and noise of the command."""

LARGEST_ORDER = 50
"""Largest order of excitation that is counted; the value means "at least"."""

MINUTE = 60.0
"""Length of other records that models are compared with where there are many, s: they repeat every two."""

BAND = np.geomspace(0.5, 10.0, 60)
"""Band in which responses are compared, Hz: from the lowest line of a waveform file to the highest of a test."""


class Excited(NamedTuple):
    """Orders of excitation of a record: of its waveform file, if one was played, and of the commanded angle.

    Of the command, components above `AUDIBLE` count, `LARGEST_ORDER` at most [Morris1996, sec. II.2].
    """

    file: int | None
    command: int


@dataclass(frozen=True, eq=False)
class DataSetModel:
    """One structure identified from one record.

    Attributes:
        record: Name of the scenario.
        structure: What was asked for.
        model: The model.
        needed: Order of excitation that its parameters need.
        enough: Whether the record's command excites as much.
        bandwidth_hz: Recovered bandwidth, Hz; NaN where the gain does not fall by 3 dB below Nyquist.
        ci95: Its 95 % interval, Hz.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
        dc_gain: Gain at 0 Hz.
        poles: Poles from input to output, largest modulus first.
        whiteness_p: p-value of the whiteness of its residuals on its own record.
        independence_p: p-value of their independence of the input.
        fits: How it follows records, its own among them, by name: all of its own, and of others where they
            were asked for, else a minute of them.
    """

    record: str
    structure: Structure
    model: StateSpace
    needed: int
    enough: bool
    bandwidth_hz: float
    ci95: tuple[float, float]
    half_power_hz: float
    dc_gain: float
    poles: tuple[complex, ...]
    whiteness_p: float
    independence_p: float
    fits: Mapping[str, Fits]

    @property
    def radius(self) -> float:
        """Largest modulus of a pole."""
        return max((abs(pole) for pole in self.poles), default=0.0)

    @property
    def stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return self.radius < 1.0

    @property
    def own(self) -> Fits:
        """Fit to its own record."""
        return self.fits[self.record]

    @property
    def others(self) -> Mapping[str, Fits]:
        """Fit to unseen records: neither its own nor one that plays the same sequence."""
        return {name: fit for name, fit in self.fits.items() if not _same_sequence(self.record, name)}

    @property
    def others_simulation(self) -> float:
        """Median fit in simulation to them, percent; NaN where there are none."""
        return median(fit.simulation for fit in self.others.values()) if self.others else float("nan")


class Refusal(NamedTuple):
    """A structure that could not be identified from a record, with the reason."""

    record: str
    structure: Structure
    reason: str


@dataclass(frozen=True, eq=False)
class DataSets:
    """Models of one joint from each of its records.

    Attributes:
        joint: Name of the joint.
        single: Names of its single-joint tests that are there.
        excited: What each record excites, by name, in the order of the thesis' tables.
        models: Record by record, structure by structure.
        refused: What could not be identified.
        missing: Records that are not there, with the reason.
    """

    joint: str
    single: tuple[str, ...]
    excited: Mapping[str, Excited]
    models: tuple[DataSetModel, ...]
    refused: tuple[Refusal, ...] = ()
    missing: Mapping[str, str] = field(default_factory=dict)

    def singles(self, method: str | None = None, *, enough: bool = False) -> tuple[DataSetModel, ...]:
        """Models from single-joint tests, the same in every study: of one method or all, `enough` excited or all."""
        return tuple(
            m
            for m in self.models
            if m.record in self.single and method in (None, m.structure.method) and (m.enough or not enough)
        )

    def find(self, record: str, method: str) -> DataSetModel | None:
        """The model of one method from one record, where there is one."""
        return next((m for m in self.models if (m.record, m.structure.method) == (record, method)), None)


def every_data_set(
    joint: str, campaign: Campaign, *, judged: Collection[str] = (), thorough: bool = False, part: Part = NO_REPORT
) -> DataSets:
    """Identify a joint from every record.

    Args:
        joint: Name of the joint.
        campaign: The records.
        judged: Names of records whose models are laid beside every other single-joint record, all of it.
        thorough: Whether to take the joint's own channel of the tests of several joints too, and to lay every model
            beside every single-joint record, a minute of it.
        part: This part of the work.
    """
    single = [single_joint_test(number, joint) for number in SINGLE_JOINT]
    records = [*single, *(names("mimo") if thorough else ()), *([RPCM] if thorough else ())]
    data = {name: campaign.record(name, joint) for name in records if name in campaign.logs}
    judges = {name: data[name] for name in single if name in data}
    minutes = {name: record[: round(MINUTE / record.dt)] for name, record in judges.items()} if thorough else {}
    excited = {name: _excited(name, record, campaign) for name, record in data.items()}
    models, refused = [], []
    for (name, record), _ in part.split(tuple(data.items())):
        for structure in every_structure(joint):
            others = judges if name in judged else minutes
            try:
                models.append(_identified(name, record, structure, excited[name], {**others, name: record}))
            except SysidError as error:
                refused.append(Refusal(name, structure, str(error)))
    missing = {name: campaign.failed.get(name, "it was not played") for name in records if name not in data}
    return DataSets(
        joint, tuple(judges), MappingProxyType(excited), tuple(models), tuple(refused), MappingProxyType(missing)
    )


def _same_sequence(record: str, other: str) -> bool:
    """Whether two records play the same sequence, so that neither can validate a model of the other."""
    return record == other or (plays_identified_sequence(record) and plays_identified_sequence(other))


def _excited(name: str, record: IOData, campaign: Campaign) -> Excited:
    scenario = campaign_scenario(name, seed=campaign.seed, duration=campaign.duration)
    files = [entry.waveform().order_of_excitation() for entry in scenario.excitation]
    command = sysid.order_of_excitation(
        record.u[:, 0], max_order=min(LARGEST_ORDER, len(record) // 2), tolerance=AUDIBLE
    )
    return Excited(max(files) if files else None, command)


def _identified(
    name: str, record: IOData, structure: Structure, excited: Excited, judges: Mapping[str, IOData]
) -> DataSetModel:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        model = estimate(record, structure.estimator, structure.orders)
        band = model.bandwidth()
        test = sysid.resid(model, record)
        followed = {other: fits(model, data) for other, data in judges.items()}
    needed = excitation_needed(structure)
    return DataSetModel(
        record=name,
        structure=structure,
        model=model.model,
        needed=needed,
        enough=excited.command >= needed,
        bandwidth_hz=float(band.hz[0, 0]),
        ci95=(float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0])),
        half_power_hz=half_power_hz(model.model),
        dc_gain=float(model.dc_gain()[0, 0]),
        poles=tuple(complex(pole) for pole in model.poles()),
        whiteness_p=float(test.whiteness_p[0]),
        independence_p=float(test.independence_p[0, 0]),
        fits=MappingProxyType(followed),
    )


def excitation_needed(structure: Structure) -> int:
    """Order of excitation that the path from input to output needs: its number of parameters [Ljung1999, ch. 13].

    OKID estimates p + 1 coefficients of the input in one least squares, whatever order is realised from them.
    """
    if structure.estimator == "okid":
        return structure.orders[1] + 1
    # A or F, and B: the first two orders of every polynomial structure here
    return structure.orders[0] + structure.orders[1]


def distances(models: tuple[DataSetModel, ...]) -> np.ndarray:
    """Distances |G_i - G_j| / |G_median| over `BAND`, root mean square (pairs,), of models of one method."""
    responses = np.array([m.model.frequency_response(BAND)[:, 0, 0] for m in models])
    if len(responses) < 2:
        return np.zeros(0)
    centre = np.median(responses.real, axis=0) + 1j * np.median(responses.imag, axis=0)
    first, second = np.triu_indices(len(responses), 1)
    return np.linalg.norm(responses[first] - responses[second], axis=1) / np.linalg.norm(centre)

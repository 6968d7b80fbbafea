"""Models of the thesis' structures from every data set: do the data sets give the same model?"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

import sysid
from scenarios.experiments.campaign import RPCM, SINGLE_JOINT, campaign_scenario, single_joint_test
from scenarios.experiments.model_structures import Structure, every_structure
from scenarios.experiments.registry import names
from scenarios.thesis.campaign import ESTIMATION_TEST, Campaign, plays_identified_sequence
from scenarios.thesis.estimates import Fits, IdentifiedModel, identified
from scenarios.thesis.steps import NO_REPORT, Part
from sysid import IOData, SysidError

AUDIBLE = 0.1
"""Least power of an exciting component, as a fraction of the strongest one's.

Below lie rounding and the noise of the hand controller: a threshold of a hundredth let that noise excite every order.
"""

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
class DataSetModel(IdentifiedModel):
    """A model identified from one record, with fits to records by name, its own among them.

    The fit to its own record is that to all of it; fits to others are to a minute of each, except of models from the
    estimation test.

    Attributes:
        record: Name of the scenario.
        needed: Order of excitation that its parameters need.
        enough: Whether the record's command excites as much.
    """

    record: str
    needed: int
    enough: bool

    @property
    def own(self) -> Fits:
        """Fit to its own record."""
        return self.fits[self.record]

    @property
    def others(self) -> Mapping[str, Fits]:
        """Fit to unseen records: neither its own nor one that plays the same sequence."""
        seen = {self.record}
        # The velocity limit turns both amplitudes of the sequence into nearly the same command.
        if plays_identified_sequence(self.record):
            seen.update(name for name in self.fits if plays_identified_sequence(name))
        return {name: fit for name, fit in self.fits.items() if name not in seen}

    @property
    def others_simulation(self) -> float:
        """Median fit in simulation to unseen records, percent; NaN where there are none."""
        return median(fit.simulation for fit in self.others.values()) if self.others else float("nan")


@dataclass(frozen=True, eq=False)
class DataSets:
    """Models of one joint from each of its records.

    Attributes:
        excited: What each record excites, by name, in the order of the thesis' tables.
        models: Record by record, structure by structure.
        refused: Records and structures that could not be identified, with the reason.
        missing: Records that are not there, with the reason.
    """

    joint: str
    excited: Mapping[str, Excited]
    models: tuple[DataSetModel, ...]
    refused: tuple[tuple[str, Structure, str], ...]
    missing: Mapping[str, str]

    @property
    def single(self) -> tuple[str, ...]:
        """Names of its single-joint tests that are there."""
        return tuple(name for name in self.excited if name.startswith("siso-"))

    def singles(self, method: str | None = None, *, enough: bool = False) -> tuple[DataSetModel, ...]:
        """Models from single-joint tests, the same in every study: of one method or all, `enough` excited or all."""
        models = [model for model in self.models if model.record in self.single]
        if enough:
            models = [model for model in models if model.enough]
        if method is not None:
            models = [model for model in models if model.method == method]
        return tuple(models)

    def find(self, record: str, method: str) -> DataSetModel | None:
        """The model of one method from one record, where there is one."""
        matching = (model for model in self.models if (model.record, model.method) == (record, method))
        return next(matching, None)


def every_data_set(joint: str, campaign: Campaign, *, thorough: bool = False, part: Part = NO_REPORT) -> DataSets:
    """Identify a joint from every record; models of the estimation test are laid beside all single-joint records.

    A `thorough` study takes the joint's own channel of the tests of several joints too, and lays every model beside a
    minute of every single-joint record.
    """
    single_joint_names = [single_joint_test(number, joint) for number in SINGLE_JOINT]
    several_joint_names = (*names("mimo"), RPCM) if thorough else ()
    record_names = [*single_joint_names, *several_joint_names]
    data = {name: campaign.record(name, joint) for name in record_names if name in campaign.logs}
    missing = {name: campaign.failed.get(name, "it was not played") for name in record_names if name not in data}
    judges = {name: data[name] for name in single_joint_names if name in data}
    minutes: dict[str, IOData] = {}
    if thorough:
        # A model of every structure from every record meets every judge: hundreds of fits, each a quarter as long.
        minutes = {name: record[: round(MINUTE / record.dt)] for name, record in judges.items()}

    excited: dict[str, Excited] = {}
    models: list[DataSetModel] = []
    refused: list[tuple[str, Structure, str]] = []
    for (name, record), _ in part.split(tuple(data.items())):
        excited[name] = _excited(name, record, campaign)
        others = judges if name == single_joint_test(ESTIMATION_TEST, joint) else minutes
        # Its own record is followed whole, in place of a minute of it.
        judged_by = {**others, name: record}
        for structure in every_structure(joint):
            needed = excitation_needed(structure)
            enough = excited[name].command >= needed
            try:
                model = identified(record, structure, judged_by)
                models.append(DataSetModel(**vars(model), record=name, needed=needed, enough=enough))
            except SysidError as error:
                refused.append((name, structure, str(error)))
    return DataSets(joint, MappingProxyType(excited), tuple(models), tuple(refused), MappingProxyType(missing))


def _excited(name: str, record: IOData, campaign: Campaign) -> Excited:
    """Orders of excitation of a scenario's waveform files, the highest, and of the recorded command."""
    scenario = campaign_scenario(name, seed=campaign.seed, duration=campaign.duration)
    file_orders = [excitation.waveform().order_of_excitation() for excitation in scenario.excitation]
    # The exchange of the replacement unit plays no waveform file.
    file_order = max(file_orders, default=None)
    # `order_of_excitation` takes orders up to half of the samples.
    largest_order = min(LARGEST_ORDER, len(record) // 2)
    command_order = sysid.order_of_excitation(record.u[:, 0], max_order=largest_order, tolerance=AUDIBLE)
    return Excited(file_order, command_order)


def excitation_needed(structure: Structure) -> int:
    """Order of excitation that the path from input to output needs: its number of parameters [Ljung1999, ch. 13].

    OKID estimates p + 1 coefficients of the input in one least squares, whatever order is realised from them.
    """
    if structure.estimator == "okid":
        _, p = structure.orders
        return p + 1
    # The coefficients of A or F, and of B, are the first two orders of every polynomial structure here.
    return structure.orders[0] + structure.orders[1]


def distances(models: tuple[DataSetModel, ...]) -> np.ndarray:
    """Distances |G_i - G_j| / |G_median| over `BAND`, root mean square (pairs,), of models of one method."""
    responses = np.array([model.estimate.model.frequency_response(BAND)[:, 0, 0] for model in models])
    if len(responses) < 2:
        return np.zeros(0)
    # A median, because one unstable model of many would carry a mean, and with it the scale, away.
    centre = np.median(responses.real, axis=0) + 1j * np.median(responses.imag, axis=0)
    # Each pair once, no model with itself.
    first, second = np.triu_indices(len(responses), 1)
    return np.linalg.norm(responses[first] - responses[second], axis=1) / np.linalg.norm(centre)

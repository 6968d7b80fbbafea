"""From the name of a problem of the twin and a seed to the experiment, and from its log to the record."""

from dataclasses import replace

import numpy as np

from hmtb_twin import Experiment, JointLog
from hmtb_twin.parameters.values import HAND_CONTROLLER, SAMPLE_RATE, SAMPLE_TIME
from scenarios.experiments.campaign import REGISTER
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.experiments.scenario import Scenario
from scenarios.problems.twin_name import TwinName
from sysid import IOData
from sysid.records.arrays import FloatArray

SETTLING = 256
"""Samples of a record in which the arm, which starts at rest, comes into its periodic answer: they do not count."""

F_MAX = 5.0
"""Highest line of the multisines, Hz: all that a record tells of the response lies below."""

CLOCK = 2
"""Samples per bit of the binary sequences, as in the thesis' tests 5 and 6."""

SWEEP = (0.5, 4.5)
"""Band of the chirp, Hz: whole cycles in its window of 2 s, and the bandwidths of the joints inside."""


def multisines(name: TwinName, seed: int, *, realisations: int = 2) -> Multisines:
    """The excitation class of a multisine problem.

    Args:
        name: The problem.
        seed: Draws the phases.
        realisations: How many waveforms.
    """
    period = name.period * SAMPLE_TIME
    return Multisines(
        rms=name.mrad / 1000.0,
        f_min=1.0 / period,
        f_max=F_MAX,
        period=period,
        realisations=realisations,
        periods=name.samples // name.period,
        settling=SETTLING // name.period,
        seed=seed,
    )


def frequencies(name: TwinName) -> FloatArray:
    """Lines of the problem up to `F_MAX` (nf,), Hz: multiples of one over the period, which its excitation has."""
    count = int(np.floor(F_MAX * name.period / SAMPLE_RATE + 1e-9))
    return np.asarray(np.arange(1, count + 1) * (SAMPLE_RATE / name.period))


def twin_experiment(name: TwinName, seed: int) -> Experiment:
    """The experiment of a draw.

    Args:
        name: The problem.
        seed: Of the draw: of the laboratory's noise, and of the waveform where the name does not say which.

    Raises:
        ScenarioError: The converters do not give the amplitude.
    """
    waveform = name.waveform_seed(seed)
    if name.excitation == "multisine":
        experiment = MultisineExperiment(
            str(name), (name.joint,), multisines(name, waveform), variant=name.variant, seed=seed
        )
        experiment.volts()  # what the converter cannot play is said before a batch begins
        return experiment
    volts = name.mrad / 1000.0 / HAND_CONTROLLER.gain
    excitations = {
        "prbs": lambda: Excitation(
            "prbs", {"amplitude": volts, "clock": CLOCK, "seed": waveform, "register": REGISTER}
        ),
        "chirp": lambda: Excitation(
            "chirp", {"f_start": SWEEP[0], "f_end": SWEEP[1], "amplitude": float(np.sqrt(2.0)) * volts}
        ),
    }
    return Scenario(
        name=str(name).replace("@", "+"),
        axes=(name.joint,),
        excitation=(excitations[name.excitation](),),
        duration=(SETTLING + name.samples) * SAMPLE_TIME,
        seed=seed,
        variant=name.variant,
    )


def twin_record(name: TwinName, log: JointLog) -> IOData:
    """The record of a log: commanded and measured angle about the operating point, rad.

    The operating point is the mean over the steady periods, whole ones, so that it is no part of the answer to the
    excitation. The settling stays as an initialisation window: the arm starts at rest there.
    """
    record = replace(log.iodata(name.joint), window=SETTLING, name=str(name))
    u, y = (part - part[SETTLING:].mean(axis=0) for part in (record.u, record.y))
    return replace(record, u=u, y=y)

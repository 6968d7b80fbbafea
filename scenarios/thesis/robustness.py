"""Robustness of methods: models from records with disturbances of rising degree [Morris1996, sec. VI.6].

Every model is identified from a record of the PRBS test, disturbed; its bandwidth is compared with the truth and its
simulation with clean records of other waveforms. The PRBS of twice the amplitude is none of them: it plays the
same sequence, which every model has seen.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmtb_twin import STUDIED_JOINTS, JointTruth
from scenarios.experiments.model_structures import STRUCTURES, Structure, every_structure
from scenarios.identification.methods import estimate
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES, TREATMENTS, Disturbance
from scenarios.thesis.robustness_outcome import (
    Failure,
    OrderNeeded,
    Robustness,
    RobustnessOutcome,
    orders_needed,
    simulated_fit,
)
from scenarios.thesis.steps import NO_REPORT, Part
from sysid import IOData, SysidError, SysidWarning
from sysid.models.bandwidth import half_power_hz

JUDGES = (2, 7, 8)
"""Tests that judge a model by its median fit to those that there are: two tones, pulses, chirp, one of each waveform
that the single-joint tests have beside binary sequences (a single tone is one of the two)."""

JUDGED = 3000
"""Samples of them that a model is compared with, a minute: every waveform file repeats in 2 s."""

SEED = 25
"""Second seed of all random draws here, beside the study's own."""

PART = 2000
"""Length of the disturbed part in samples, 40 s from the start: twenty periods of the waveform."""


def sysid_method(joint: str) -> str:
    """The prediction-error method that the thesis chose for a joint."""
    return next(entry.method for entry in STRUCTURES[joint] if entry.chosen and entry.method != "okid")


def other_structures(joint: str) -> tuple[Structure, ...]:
    """Return the structures that the thesis tried and did not choose: the other prediction-error structure, and ARX."""
    return tuple(
        entry for entry in every_structure(joint) if entry.method in ("armax", "oe", "arx") and not entry.chosen
    )


def robustness(
    campaign: Campaign, estimation_test: int, *, thorough: bool = True, part: Part = NO_REPORT
) -> Robustness:
    """Disturb the estimation records and identify models from them.

    Args:
        campaign: The records.
        estimation_test: Number of the test that models are identified from.
        thorough: Whether to disturb records by degree, or only to find the orders that finding F25 rests on.
        part: This part of the work.

    Returns:
        What came of it; a joint without the estimation record or any that judges is left out.
    """
    outcomes: list[RobustnessOutcome] = []
    orders: list[OrderNeeded] = []
    judged_by: dict[str, tuple[int, ...]] = {}
    for joint, of_joint in part.split(STUDIED_JOINTS):
        data = campaign.singles(joint)
        numbers = tuple(number for number in JUDGES if number in data and number != estimation_test)
        if not numbers or estimation_test not in data:
            continue
        judged_by[joint] = numbers
        judges = tuple(data[number][:JUDGED] for number in numbers)
        chosen = tuple(entry for entry in STRUCTURES[joint] if entry.chosen)
        with warnings.catch_warnings():
            # Warnings are what this experiment provokes; failures are counted.
            warnings.simplefilter("ignore", SysidWarning)
            for disturbance, share in of_joint.split(tuple(DISTURBANCES.values()) if thorough else ()):
                also = other_structures(joint) if disturbance.other_structures else ()
                trial = _Trial(data[estimation_test], judges, campaign.truth.joint(joint), campaign.seed or 0)
                outcomes += trial.outcomes(disturbance, (*chosen, *also), share)
            orders += orders_needed(joint, campaign, data[estimation_test], judges)
    return Robustness(tuple(outcomes), tuple(orders), judged_by)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Estimation and validation records of one joint."""

    data: IOData
    judges: Sequence[IOData]
    truth: JointTruth
    seed: int

    def outcomes(
        self, disturbance: Disturbance, structures: Sequence[Structure], part: Part
    ) -> list[RobustnessOutcome]:
        outcomes = []
        clean = self.data if disturbance.whole else self.data[:PART].detrend()
        for treatment, of_treatment in part.split(disturbance.treatments):
            for degree, _ in of_treatment.split(disturbance.degrees):
                for draw in range(self._draws(disturbance, degree)):
                    disturbed = TREATMENTS[treatment](
                        disturbance.spoil(clean, degree, self._chance(disturbance, degree, draw))
                    )
                    for structure in structures:
                        # The others stand beside the chosen ones, untreated and of the first draw.
                        if not structure.chosen and (draw or treatment != AS_IT_IS[0]):
                            continue
                        place = (disturbance.key, treatment, degree, draw)
                        outcomes.append(self._outcome(structure, disturbed, *place))
        return outcomes

    def _draws(self, disturbance: Disturbance, degree: float) -> int:
        """No draw of parts longer than the record, and one of the record as a whole."""
        if disturbance.key != "length":
            return disturbance.draws
        length, whole = round(degree / self.data.dt), len(self.data)
        return disturbance.draws if length < whole else int(length == whole)

    def _chance(self, disturbance: Disturbance, degree: float, draw: int) -> np.random.Generator:
        """Seed of a draw: the same for every structure and treatment."""
        joint, kind = STUDIED_JOINTS.index(self.truth.name), list(DISTURBANCES).index(disturbance.key)
        if disturbance.key.endswith("drop-outs"):
            # Held and marked lose the same samples.
            kind = list(DISTURBANCES).index("held drop-outs")
        step = DISTURBANCES[disturbance.key].degrees.index(degree)
        return np.random.default_rng(np.random.SeedSequence((SEED, self.seed, joint, kind, step, draw)))

    def _outcome(
        self, structure: Structure, disturbed: IOData, key: str, treatment: str, degree: float, draw: int
    ) -> RobustnessOutcome:
        hz = fit = level = slowest = float("nan")
        failure: Failure = ""
        covers = False
        try:
            model = estimate(disturbed, structure.estimator, structure.orders)
        except SysidError:
            failure = "refused"
        else:
            band = model.bandwidth()
            if not model.model.is_stable():
                failure = "unstable"
            elif np.isnan(band.hz[0, 0]):
                failure = "no bandwidth"
            else:
                hz, covers = float(band.hz[0, 0]), bool(band.covers(self.truth.bandwidth_hz)[0, 0])
            slowest = float(np.abs(model.poles()).max(initial=0.0))
            fit, level = simulated_fit(model, self.judges), half_power_hz(model.model)
        return RobustnessOutcome(
            joint=self.truth.name,
            method=structure.method,
            chosen=structure.chosen,
            disturbance=key,
            treatment=treatment,
            degree=degree,
            draw=draw,
            failure=failure,
            bandwidth_hz=hz,
            error=100 * (hz / self.truth.bandwidth_hz - 1),
            covers=covers,
            fit=fit,
            half_power_hz=level,
            slowest=slowest,
        )

"""Summary of the truth about an arm at an operating point, for the screen and for JSON."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hmtb_twin import NOMINAL_PLANT, Arm, JointLog, JointTruth, Truth
from hmtb_twin.arm.arm_model import servo_law
from hmtb_twin.parameters.drives import Actuator
from hmtb_twin.truth.analytic_hydraulics import LinearHydraulics, linear_hydraulics
from scenarios.files.errors import ScenarioError
from scenarios.truth.attainable import Attainable, attainable
from scenarios.truth.best_linear import BestLinearTruth, cautions

LOCKED = 1e-2
"""Gain at 0 Hz below which a joint does not follow its command."""

LOCKED_NOTE = "locked: the joint is indexed and does not follow a command, so it has no bandwidth"


@dataclass(frozen=True, eq=False)
class TruthSummary:
    """The truth about an arm.

    Attributes:
        arm: The arm.
        truth: Its small-signal truth.
        joints: The same, joint by joint.
        hydraulics: Each joint's actuator on the inertia that it sees, the others held; empty for electric drives
            and for servo valves with orifices, which have no linear flow law.
        best_linear: Best linear approximation of each studied joint, where it was measured.
        attainable: Attainable errors on a record by joint, where one was given.
    """

    arm: Arm
    truth: Truth
    joints: Mapping[str, JointTruth]
    hydraulics: Mapping[str, LinearHydraulics]
    best_linear: Mapping[str, BestLinearTruth] = field(default_factory=dict)
    attainable: Mapping[str, Attainable] = field(default_factory=dict)

    @property
    def locked(self) -> frozenset[str]:
        """Joints that do not follow their commands."""
        return frozenset(name for name, joint_truth in self.joints.items() if abs(joint_truth.dc_gain) < LOCKED)

    def record(self) -> dict[str, object]:
        """Return what `hmtb truth --json` prints."""
        truth = self.truth
        record: dict[str, object] = {
            "dt": truth.dt,
            "variant": truth.variant,
            "payload": truth.payload,
            "pose": truth.pose,
            "angles_rad": truth.angles,
            "plant": vars(truth.plant),
            "specimen": truth.specimen.deviations,
            "joints": {name: self._joint_record(name) for name in self.joints},
            "small_signal_error": truth.small_signal_error,
            "provenance": truth.provenance,
        }
        # Without process noise there is no noise model: K is None.
        if truth.plant.process_noise:
            record["noise"] = {
                "drive_torque_nm": self.arm.process_noise,
                "resolver_covariance_rad2": truth.disturbances.resolvers,
                "K": truth.model.K,
                "innovation_covariance_rad2": truth.model.innovation_covariance,
            }
        if self.best_linear:
            record["best_linear"] = {
                name: _best_linear_record(approximation, truth) for name, approximation in self.best_linear.items()
            }
        if self.attainable:
            record["attainable"] = {name: _attainable_record(floors) for name, floors in self.attainable.items()}
        return record

    def _joint_record(self, name: str) -> dict[str, object]:
        """Return what `hmtb truth --json` prints of one joint."""
        joint_truth = self.joints[name]
        locked = name in self.locked
        bandwidth_hz = None if locked else joint_truth.bandwidth_hz
        dominant_poles = np.empty(0) if locked else joint_truth.dominant_poles
        note = LOCKED_NOTE if locked else None
        record: dict[str, object] = {
            "bandwidth_hz": bandwidth_hz,
            "dc_gain": joint_truth.dc_gain,
            "poles": np.asarray(joint_truth.poles, dtype=complex),
            "zeros": np.asarray(joint_truth.zeros, dtype=complex),
            "delay_samples": joint_truth.delay_samples,
            "dominant": [_pole_record(pole) for pole in dominant_poles],
            "note": note,
        }
        # Without process noise the innovations are the recorder's noise, which says nothing of the joint.
        if self.truth.plant.process_noise and joint_truth.model.innovation_covariance is not None:
            record["innovation_sd_rad"] = float(np.sqrt(joint_truth.model.innovation_covariance[0, 0]))
        if name in self.hydraulics:
            oil = self.hydraulics[name]
            record["hydraulics"] = {
                "inertia_kgm2": oil.inertia,
                "resonance_hz": oil.natural_frequency / (2.0 * np.pi),
                "damping_ratio": oil.damping_ratio,
                "stall_torque_nm": oil.stall_torque,
                "no_load_speed_rad_s": oil.no_load_speed,
            }
        return record


def _pole_record(pole: complex) -> dict[str, float]:
    """Describe a pole in the s plane, rad/s, by its parts, its frequency and its damping."""
    return {
        "re": float(pole.real),
        "im": float(pole.imag),
        "hz": float(abs(pole) / (2.0 * np.pi)),
        "damping_ratio": damping_ratio(pole),
    }


def _best_linear_record(approximation: BestLinearTruth, truth: Truth) -> dict[str, object]:
    """Return what `hmtb truth --bla --json` prints of one joint."""
    hz, *ci95 = approximation.bandwidth.path()
    servo = approximation.servo
    # Noise and nonlinear distortion together: the scatter over realisations.
    standard_error = np.sqrt(servo.total_variance[:, 0, 0])
    return {
        "amplitude_rad": approximation.experiment.multisines.rms,
        "bandwidth_hz": hz,
        "ci95": tuple(ci95),
        "realisations": approximation.experiment.multisines.realisations,
        "distortion_percent": float(approximation.distortion_percent[0]),
        "velocity_limited_share": approximation.slewing,
        "cautions": cautions(approximation, truth),
        "frequency_hz": servo.response.frequencies,
        "response": servo.response.response[:, 0, 0],
        "standard_error": standard_error,
    }


def _attainable_record(floors: Attainable) -> dict[str, object]:
    """Return what `hmtb truth --data --json` prints of one joint."""
    simulation = {name: vars(floor) for name, floor in vars(floors.simulation).items()}
    return {
        "samples": floors.samples,
        "chance_takes_off": 1.0 - floors.by_chance(1.0),
        "spread_rad": floors.spread,
        "mean_error_rad": floors.mean_error,
        "simulation": {**simulation, "right_order": vars(floors.right_order)},
        "one_step": {name: vars(floor) for name, floor in vars(floors.one_step).items()},
        "order": floors.order,
    }


def truth_summary(arm: Arm, truth: Truth) -> TruthSummary:
    """Return the summary of an arm and its small-signal truth."""
    hydraulics = {}
    # Orifices have no linear law of load and flow, hence no spring and damper of their own.
    if hydraulic(arm) and arm.plant.actuator == "linear":
        inertias = np.diag(arm.inertia(truth.angles))
        for name, inertia in zip(arm.joints, inertias, strict=True):
            hydraulics[name] = linear_hydraulics(arm.actuators[name], float(inertia))
    return TruthSummary(arm, truth, {name: truth.joint(name) for name in arm.joints}, hydraulics)


def attainable_on(log: JointLog, truth: Truth) -> dict[str, Attainable]:
    """Return the floors of every joint that a log excites.

    Raises:
        ScenarioError: The log excites directions of the tool, or see `attainable`.
    """
    joints = [axis for axis in log.axes if axis in log.joints]
    if not joints:
        raise ScenarioError(
            f"{log.name} excites {', '.join(log.axes)}, directions of the tool; expected a log that excites joints"
        )
    return {joint: attainable(log, joint, truth=truth) for joint in joints}


def hydraulic(arm: Arm) -> bool:
    """Whether all drives of the arm are hydraulic."""
    return all(isinstance(drive, Actuator) for drive in arm.drives.values())


def conditions_in_words(arm: Arm, *, departures: bool = False) -> str:
    """Return what the arm's drives run on and rub with, in words and with units; of oil only where there is some.

    Args:
        arm: The arm.
        departures: Leave out what is nominal; the text is empty where all is.
    """
    plant, nominal, oil = arm.plant, NOMINAL_PLANT, hydraulic(arm)
    drives = f"{plant.actuator} actuators" if oil else "electric drives"
    servo = servo_law(arm.description, plant)
    # Whether a condition departs from the nominal one, and its description.
    conditions = [
        (plant.actuator != nominal.actuator, drives),
        (plant.servo != nominal.servo, f"servo {servo}"),
        (plant.friction != nominal.friction, f"friction {plant.friction}"),
    ]
    if arm.friction and plant.friction_level != nominal.friction_level:
        conditions.append((True, f"dry friction {plant.friction_level:g} times the arm's"))
    if oil:
        pressure, celsius = plant.supply_pressure, plant.oil_temperature
        conditions.append((pressure != nominal.supply_pressure, f"supply pressure {pressure:g} MPa"))
        conditions.append((celsius != nominal.oil_temperature, f"oil at {celsius:g} °C"))
        slope = f"load-flow slope {plant.load_flow_slope:g} of the straight line's"
        conditions.append((plant.load_flow_slope != nominal.load_flow_slope, slope))
    if plant.process_noise:
        conditions.append((True, f"process noise {plant.process_noise:g} of the rated torque"))
    # By name: a value for each body would fill the page.
    deviations = [name.replace("_", " ") for name in arm.specimen.deviations]
    if deviations:
        conditions.append((True, f"a specimen whose {', '.join(deviations)} deviate"))
    return ", ".join(description for departs, description in conditions if departs or not departures)


def pose_in_words(truth: Truth) -> str:
    """Return the pose's name, or its angles in degrees."""
    if truth.pose != "given angles":
        return truth.pose
    # Degrees pass through radians: rounding shows the number that was asked for.
    degrees = np.round(np.degrees(truth.angles), 6)
    return ",".join(f"{angle:g}" for angle in degrees) + " deg"


def damping_ratio(pole: complex) -> float:
    """Return the damping ratio of a pole in the s plane: 1 where it is real and stable."""
    # The imaginary part of a real pole is rounding of the eigenvalues; its quotient would fall a little short of one.
    if abs(pole.imag) <= 1e-9 * abs(pole):
        return float(np.sign(-pole.real))
    return float(-pole.real / abs(pole))

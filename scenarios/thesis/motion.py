"""Campaign over how far the arm moves, against what friction, by what servo: records, models, and what they show.

The thesis prints neither the unit of the hand controller's gain nor the friction, the servo or the noise. Each setting
of these is tried on each joint alone; `motion_score` compares what comes out with all that the thesis prints.
"""

import itertools
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS, HandController, JointLog, Plant, TwinError, simulate
from hmtb_twin.parameters.values import GAINS
from hmtb_twin.parameters.variants import ACTUATORS
from scenarios.experiments.campaign import campaign_scenario, single_joint_test
from scenarios.experiments.log_review import prepared, velocity_limited_share
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.identification.identification import long_lag
from scenarios.jobs.executor import Executor
from scenarios.jobs.journal import Journal
from scenarios.thesis.estimates import estimate
from scenarios.thesis.findings_chapter_3 import FASTEST, orders_below
from scenarios.thesis.nonparametric import GRID, SINES, WHITENING
from sysid import FrequencyResponse, IOData, SysidError, SysidWarning
from sysid.frequency.delayest import whitened_correlations
from sysid.models.bandwidth import HALF_POWER, gain_crossing

METHODS = ("armax", "oe", "okid")
"""Methods of the thesis that give a model."""

TESTS = {1.0: 5, 2.0: 6}
"""Number of the single-joint test by the amplitude of its binary sequence, V."""

HEAVY = 0.02
"""Friction times slope above this, in parts of stall torque, would hold the arm against commands of smaller gains."""

SLOW = "shoulder_yaw"
"""The joint whose printed models are slow; friction above `HEAVY` is tried on it alone."""

MOST_LAGS = 20
"""Largest lag of the correlation whose peak is the delay."""

LEVEL = 0.99
"""Level of the tests of residuals and correlations [Morris1996, ch. IV]."""

RESPONSE = np.geomspace(0.02, 24.0, 300)
"""Frequencies at which models are read, Hz."""

MULTISINE_PERIOD = 20.4
"""Period of the multisines, s: whole numbers of samples, and of cycles of each of their tones."""

JOURNAL = "motion.sqlite"
"""Name of the file of finished settings."""

Row = dict[str, Any]
"""What one record shows, by name."""


@dataclass(frozen=True, order=True)
class Setting:
    """One setting of the laboratory, a level of each factor of docs/motion.md, and one joint.

    Slope of the load-flow line over the straight one's, gain in rad/V, friction in parts of stall torque, presliding in
    rad, hold in samples, noise in V.
    """

    servo: str
    slope: float
    gain: float
    friction: float
    presliding: float
    hold: int
    noise: float
    joint: str

    def __str__(self) -> str:
        return " ".join(map(str, asdict(self).values()))

    def applied(self, scenario: Scenario) -> Scenario:
        """Return the same experiment in this setting."""
        # The level multiplies what the variant has, so that the joint in question gets the wanted friction.
        actuator = ACTUATORS[self.joint]
        level = self.friction * actuator.rated_torque / actuator.coulomb_torque
        interface = HandController(gain=self.gain, hold=self.hold, noise=self.noise)
        plant = Plant(servo=self.servo, friction_level=level, presliding=self.presliding, load_flow_slope=self.slope)
        return replace(scenario, hand_controller=interface, plant=plant)


@dataclass(frozen=True)
class MotionCampaign:
    """Levels of every factor and records of a setting, both listed in docs/motion.md.

    Attributes:
        slopes: With the torque servo, which hardly feels it, the first alone.
        frictions: Above `HEAVY` on `SLOW` alone, and with a smaller gain only where the slope makes up for it.
        presliding: With the torque servo the first alone.
        logged: White noise on the logged command, in multiples of the command's root mean square.
        drifts: Drift of the measured angle over the record, in the same multiples; with noise on the logged command
            none.
        volts: Amplitudes, V; multisines have that root mean square.
        seeds: Binary sequences, each with other noise, for every setting and amplitude, of `duration` s.
        sines: Records of two sines, of 1 V and `sines_duration` s.
        multisines: Their number for every amplitude.
    """

    servos: tuple[str, ...] = ("flow", "torque")
    slopes: tuple[float, ...] = (1.0, 0.33, 0.1)
    gains: tuple[float, ...] = tuple(sorted(GAINS.values()))
    frictions: tuple[float, ...] = (0.0007, 0.002, 0.006, 0.02, 0.06, 0.15)
    presliding: tuple[float, ...] = (1e-3,)
    holds: tuple[int, ...] = (1, 3)
    noises: tuple[float, ...] = (0.1,)
    logged: tuple[float, ...] = (0.0,)
    drifts: tuple[float, ...] = (0.0, 0.1, 0.3, 1.0)
    volts: tuple[float, ...] = (1.0, 2.0)
    seeds: int = 10
    duration: float = 24.0
    sines: int = 1
    sines_duration: float = 240.0
    multisines: int = 3

    @classmethod
    def quick(cls) -> "MotionCampaign":
        """Return a coarse campaign: one servo, the nominal chain, two frictions, two seeds, no multisines."""
        return cls(
            servos=("flow",),
            slopes=(1.0,),
            frictions=(0.0007, 0.006),
            presliding=(1e-3,),
            holds=(3,),
            noises=(0.1,),
            drifts=(0.0, 0.3),
            seeds=2,
            sines_duration=64.0,
            multisines=0,
        )

    def settings(self) -> tuple[Setting, ...]:
        """Return every setting, joint by joint."""
        levels = (
            self.servos,
            self.slopes,
            self.gains,
            self.frictions,
            self.presliding,
            self.holds,
            self.noises,
            STUDIED_JOINTS,
        )
        combinations = (Setting(*values) for values in itertools.product(*levels))
        return tuple(setting for setting in combinations if self._is_tried(setting))

    def _is_tried(self, setting: Setting) -> bool:
        """Whether a combination of levels is run; docs/motion.md lists those that are not."""
        first = setting.presliding == self.presliding[0] and setting.slope == self.slopes[0]
        if setting.servo != "flow" and not first:
            return False
        if setting.friction <= HEAVY:
            return True
        # Smaller commands would not move the arm against heavy friction; see `HEAVY`.
        moves = setting.gain == max(self.gains) or setting.friction * setting.slope <= HEAVY
        return moves and setting.joint == SLOW

    def disturbances(self) -> tuple[tuple[float, float], ...]:
        """Return what is added to a record before it is analysed: noise in the log and drift, in this order."""
        return tuple((logged, 0.0) for logged in self.logged) + tuple((0.0, drift) for drift in self.drifts if drift)


@dataclass(frozen=True)
class Recorded:
    """A record: its excitation, `prbs`, `sines` or `multisine`, its amplitude, V, the seed of noise and waveform."""

    excitation: str
    volts: float
    seed: int

    def experiment(self, campaign: MotionCampaign, setting: Setting) -> Scenario | MultisineExperiment:
        """Return the experiment, named after the record."""
        name = f"{self.excitation}-{self.volts:g}-{self.seed}"
        if self.excitation != "multisine":
            if self.excitation == "prbs":
                test, duration = TESTS[self.volts], campaign.duration
            else:
                test, duration = SINES, campaign.sines_duration
            played = campaign_scenario(single_joint_test(test, setting.joint), seed=self.seed, duration=duration)
            return replace(setting.applied(played), name=name)
        # Any scenario lends its laboratory; the binary test of this amplitude has noise of its own for every seed.
        lender = setting.applied(campaign_scenario(single_joint_test(TESTS[self.volts], setting.joint), seed=self.seed))
        multisines = Multisines(
            rms=setting.gain * self.volts, f_min=0.04, f_max=5.0, period=MULTISINE_PERIOD, seed=self.seed
        )
        laboratory = {key: getattr(lender, key) for key in ("plant", "hand_controller", "seed")}
        return MultisineExperiment(name, (setting.joint,), multisines, **laboratory)


def records_of(campaign: MotionCampaign) -> tuple[Recorded, ...]:
    """Return the records of every setting."""
    records = []
    for excitation, count in (("prbs", campaign.seeds), ("multisine", campaign.multisines)):
        for volts in campaign.volts:
            records += [Recorded(excitation, volts, seed) for seed in range(1, count + 1)]
    records += [Recorded("sines", 1.0, seed) for seed in range(1, campaign.sines + 1)]
    return tuple(records)


def run_campaign(
    campaign: MotionCampaign, executor: Executor[Any], folder: Path, progress: Callable[[int, int], None]
) -> dict[Setting, list[Row]]:
    """Run a campaign, or what the journal in `folder` lacks of it; return the rows of its settings in their order.

    The results have the same bits on any number of workers. `progress` is called with the finished settings and all.

    Raises:
        ScenarioError: The journal cannot be used, or a worker cannot run.
    """
    # A journal of other software or levels would mix results that do not belong together.
    build_fingerprint = {"format": "motion 2", "source": fingerprint(), **versions(), "campaign": str(campaign)}
    settings = {str(setting): setting for setting in campaign.settings()}
    with closing(Journal(folder / JOURNAL, build_fingerprint)) as journal:
        missing = [setting for key, setting in settings.items() if key not in journal]
        finished = len(settings) - len(missing)
        progress(finished, len(settings))
        for key, rows in executor.run(run_settings, campaign, ((setting,) for setting in missing), items="settings"):
            journal.add(key, rows)
            finished += 1
            progress(finished, len(settings))
        return {setting: journal.get(key) for key, setting in settings.items()}


def run_settings(campaign: MotionCampaign, settings: tuple[Setting, ...]) -> Iterator[tuple[str, list[Row]]]:
    """Simulate and analyse settings; for workers.

    Yields:
        The text of each setting, and a row for every record and level of noise on the logged command or of drift; of an
        experiment that failed a row with the reason.
    """
    for setting in settings:
        records = {str(record.experiment(campaign, setting).name): record for record in records_of(campaign)}
        experiments = [record.experiment(campaign, setting) for record in records.values()]
        try:
            # One thread each: the workers already take every core. A failed experiment must not cost the others.
            logs = simulate(experiments, threads=1, keep_going=True)
        except TwinError as error:
            raise ScenarioError(f"{setting}: {error}") from error
        rows: list[Row] = []
        for log in logs:
            rows += _rows(setting, records[log.name], log, campaign.disturbances())
        rows += [{"failed": f"{name}: {why}"} for name, why in logs.failed.items()]
        yield str(setting), rows


def _rows(
    setting: Setting, record: Recorded, log: JointLog, disturbances: Sequence[tuple[float, float]]
) -> Iterator[Row]:
    """Analyse a record once for every level of noise on the logged command and of drift, in parts of its spread."""
    data = prepared(log, setting.joint)
    if record.excitation == "multisine":
        # The last two periods: the response to the start of the waveform has died away by then.
        data = data[-2 * round(MULTISINE_PERIOD / data.dt) :].detrend()
    spread = float(data.u.std())
    facts = {
        **asdict(record),
        "command_rms": spread,
        "output_rms": float(data.y.std()),
        "slewing": velocity_limited_share(log),
    }
    # One draw for all levels: what differs between them is its size alone.
    # crc32, since the hash of a string differs from process to process.
    noise = np.random.default_rng([record.seed, crc32(f"{setting.joint} {log.name}".encode())])
    white = noise.standard_normal(data.u.shape)
    ramp = np.linspace(-0.5, 0.5, len(data))[:, None]
    for level, drift in disturbances:
        logged = replace(data, u=data.u + level * spread * white, y=data.y + drift * spread * ramp).detrend()
        # Unstable models overflow: `_json_number` makes None of what is not finite.
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", SysidWarning)
            analysis = _spectra(logged) if record.excitation == "sines" else _models(setting.joint, logged)
        row = {**facts, "logged": level, "drift": drift, **analysis}
        yield {name: _json_number(value) for name, value in row.items()}


def _json_number(value: Any) -> Any:
    """Round a number to seven digits, None where it is not finite; return anything else as it is."""
    # JSON has no NaN.
    if isinstance(value, float):
        return float(f"{value:.7g}") if np.isfinite(value) else None
    return value


def _spectra(data: IOData) -> Row:
    """Break frequency and disturbance by the thesis' own estimator [Morris1996, sec. III.2A and III.2C]."""
    spectrum = sysid.spa(data, lag=long_lag(data), frequencies=GRID[GRID <= FASTEST])
    return {
        "break_rad_s": 2 * np.pi * gain_crossing(spectrum.determined(), HALF_POWER),
        "disturbance_orders": orders_below(spectrum, np.isfinite(spectrum.frequencies)),
    }


def _models(joint: str, data: IOData) -> Row:
    """Read the models of a record by the thesis' methods, and its delay."""
    correlations, _ = whitened_correlations([data], WHITENING, MOST_LAGS, LEVEL)
    row: Row = {"peak_lag": int(np.argmax(correlations[:, 0, 0]))}
    for structure in STRUCTURES[joint]:
        if structure.method not in METHODS:
            continue
        name = structure.method
        try:
            fitted = estimate(data, structure.estimator, structure.orders)
            row |= {f"{name}_{key}": value for key, value in model_numbers(fitted.model).items()}
            if name == "okid":
                # The thesis' percentage is of squared singular values; two states are its order.
                values = np.asarray(fitted.diagnostics["hankel_singular_values"], dtype=float) ** 2
                row["okid_tail_percent"] = float(100.0 * values[2:].sum() / values.sum())
                continue
            test = sysid.resid(fitted, data)
        except (SysidError, np.linalg.LinAlgError):
            # Without a model every number of it is missing, which counts as the largest distance.
            continue
        row[f"{name}_white"] = bool(test.whiteness_p[0] > 1.0 - LEVEL)
        row[f"{name}_independent"] = bool(np.min(test.independence_p) > 1.0 - LEVEL)
        row[f"{name}_correlation"] = float(np.sum(test.autocorrelation[1:, 0, 0] ** 2))
    return row


def model_numbers(model: sysid.StateSpace) -> dict[str, float]:
    """Return the numbers by which models of one input and one output are compared; NaN where there is none.

    Decay rates of the two slowest poles and the frequency of the gain 0.707 in rad/s, the bandwidth in Hz.
    """
    # A pole at the origin has decayed after one sample: any rate beyond that of the fastest printed one stands for it.
    rates = np.sort(-np.log(np.maximum(np.abs(model.poles()), 1e-4)) / model.dt)
    slowest, second = (*rates.tolist(), float("nan"), float("nan"))[:2]
    response = FrequencyResponse(RESPONSE, model.frequency_response(RESPONSE), model.dt, "model")
    gain_half_hz = float(np.interp(np.log(0.5), np.log(RESPONSE), response.magnitude[:, 0, 0]))
    return {
        "slow_pole": slowest,
        "second_pole": second,
        "dc_gain": float(model.dc_gain()[0, 0]),
        "gain_half_hz": gain_half_hz,
        "half_power": 2 * np.pi * gain_crossing(response, HALF_POWER),
        "bandwidth_hz": float(model.bandwidth()[0, 0]),
    }

"""The study: excite, record, identify, compare with the truth [Morris1996]."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS, JointLog, JointTruth, Truth, linearize, load_arm, simulate
from scenarios.attribution import attribute, conditions
from scenarios.comparison import (
    Comparison,
    Cost,
    Fit,
    JointResult,
    ModelResult,
    ThreeJointModel,
    relative_error,
)
from scenarios.crossing import half_power_hz
from scenarios.errors import ScenarioError
from scenarios.estimators import estimate
from scenarios.preparation import prepared
from scenarios.provenance import versions
from scenarios.published import published
from scenarios.registry import load
from scenarios.saturation import swing, velocity_limited_share
from scenarios.scenario import Scenario
from scenarios.sensitivity import order_effects
from scenarios.waveform import POINTS, RATE
from sysid import FrequencyResponse, IOData, StateSpace, SysidWarning, block_diagonal

TESTS = tuple(range(1, 9))
"""Numbers of the single-joint tests [Morris1996, table 1]."""

ESTIMATION_TEST = 5
"""Models are identified from the PRBS of 1 V and validated on the other seven tests [Morris1996, ch. IV and V]."""


@dataclass(frozen=True)
class Structure:
    """A model structure to identify.

    Attributes:
        method: Key of the method in tables and figures.
        estimator: Name of the estimator.
        orders: Its orders.
        chosen: Whether the thesis takes it into a three-joint model.
        label: Text for tables and legends.
    """

    method: str
    estimator: str
    orders: tuple[int, ...]
    chosen: bool
    label: str


SUFFICIENT = {"shoulder_yaw": (4, 3, 2), "shoulder_pitch": (5, 3, 1), "elbow_pitch": (4, 3, 2)}
"""nb, nf, nk of the output-error model whose order suffices without friction; on the arm as it is, none does.

The Bayesian information criterion [Schwarz1978] chose them, summed over five frictionless records of small amplitude
with seeds that nothing else here uses, nb up to 6, nf up to 5, nk as published; `tests/benchmarks/test_order.py`
chooses again.
"""


def _sufficient(joint: str) -> "Structure":
    nb, nf, nk = SUFFICIENT[joint]
    return Structure("oe_high", "oe", (nb, nf, nk), False, f"OE {nb}/{nf}, delay {nk}, sufficient without friction")


_OKID = Structure("okid", "okid", (2, 5), True, "OKID order 2, p = 5")

STRUCTURES: Mapping[str, tuple[Structure, ...]] = {
    "shoulder_yaw": (
        Structure("armax", "armax", (5, 3, 5, 2), True, "ARMAX 5/3/5, delay 2"),
        Structure("oe", "oe", (2, 2, 2), False, "OE 2/2, delay 2"),
        _OKID,
        _sufficient("shoulder_yaw"),
    ),
    "shoulder_pitch": (
        Structure("armax", "armax", (2, 2, 2, 1), False, "ARMAX 2/2/2, delay 1"),
        Structure("oe", "oe", (2, 2, 1), True, "OE 2/2, delay 1"),
        _OKID,
        _sufficient("shoulder_pitch"),
    ),
    "elbow_pitch": (
        Structure("armax", "armax", (2, 2, 2, 2), True, "ARMAX 2/2/2, delay 2"),
        Structure("oe", "oe", (2, 2, 2), False, "OE 2/2, delay 2"),
        _OKID,
        _sufficient("elbow_pitch"),
    ),
}
"""What is identified: the thesis' structures, those it does not use filled in so that the table is complete, and one
of sufficient order beside them."""

Progress = Callable[[str, int, int], None]
"""Called with the name of the step, what is done and what there is in all."""


def run_study(
    *,
    seed: int | None = None,
    duration: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Run the whole study.

    Args:
        seed: Draws the noise of every experiment; the scenarios' own seeds when not given.
        duration: Length of every record instead of 240 s, s.
        threads: Threads of the simulation.
        progress: Told of every step.

    Returns:
        Models beside the truth and beside held-out data.

    Raises:
        ScenarioError: An experiment that models are identified from has failed.
    """
    begin = perf_counter()
    report = progress or (lambda step, done, total: None)
    campaign = {
        (number, joint): _planned(number, joint, seed, duration) for number in TESTS for joint in STUDIED_JOINTS
    }
    extra = [entry for joint in STUDIED_JOINTS for entry in conditions(campaign[ESTIMATION_TEST, joint])]
    truth = linearize(load_arm())
    started = perf_counter()
    result = simulate(
        [*campaign.values(), *extra], threads=threads, progress=lambda done, total: report("simulate", done, total)
    )
    simulation_s = perf_counter() - started
    logs = {log.name: log for log in result.logs}
    joints, attribution, orders = {}, {}, {}
    steps = len(STUDIED_JOINTS)
    for number, joint in enumerate(STUDIED_JOINTS):
        report("identify", number, steps)
        scenario = campaign[ESTIMATION_TEST, joint]
        if scenario.name not in logs:
            raise ScenarioError(f"{scenario.name} failed, nothing to identify from: {result.failed[scenario.name]}")
        by_test = {n: logs[campaign[n, joint].name] for n in TESTS if campaign[n, joint].name in logs}
        joints[joint] = study_joint(joint, by_test, truth.joint(joint))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            attribution[joint] = attribute(scenario, joint, logs, truth.joint(joint).bandwidth_hz, SUFFICIENT[joint])
        orders[joint] = order_effects(joints[joint].data[ESTIMATION_TEST], SUFFICIENT[joint][2])
    report("identify", steps, steps)
    return Comparison(
        truth=truth,
        joints=joints,
        three_joint=_three_joint_models(joints, truth),
        logs=logs,
        failed=dict(result.failed),
        attribution=attribution,
        orders=orders,
        cost=Cost(result.physics_seconds, simulation_s, perf_counter() - begin),
        estimation_test=ESTIMATION_TEST,
        seed=seed,
        duration=duration,
        provenance=versions(),
    )


def study_joint(joint: str, logs: Mapping[int, JointLog], truth: JointTruth) -> JointResult:
    """Identify one joint from the estimation test and validate on all others.

    Args:
        joint: Name of the joint.
        logs: Logs by number of the test.
        truth: Its small-signal truth.

    Returns:
        Models, spectra and fits.
    """
    data = {number: prepared(log, joint) for number, log in logs.items()}
    own = data[ESTIMATION_TEST]
    models = {entry.method: _identify(entry, data, truth) for entry in STRUCTURES[joint]}
    spa, etfe = _nonparametric(own)
    return JointResult(
        joint,
        truth,
        data,
        models,
        spa,
        etfe,
        published(joint),
        slewing={number: velocity_limited_share(log) for number, log in logs.items()},
        swing={number: swing(log, joint) for number, log in logs.items()},
    )


def _planned(number: int, joint: str, seed: int | None, duration: float | None) -> Scenario:
    scenario = load(f"siso-{number}-{joint}")
    if seed is not None:
        scenario = scenario.reseeded(seed)
    return scenario if duration is None else replace(scenario, duration=duration)


def _identify(structure: Structure, data: Mapping[int, IOData], truth: JointTruth) -> ModelResult:
    with warnings.catch_warnings():
        # They stand in the estimate's diagnostics, from where the report takes them.
        warnings.simplefilter("ignore", SysidWarning)
        found, _ = estimate(data[ESTIMATION_TEST], structure.estimator, structure.orders)
        band = found.bandwidth()
        fits = {number: _fit(found, record, number) for number, record in data.items()}
        test = sysid.resid(found, data[ESTIMATION_TEST])
    return ModelResult(
        method=structure.method,
        label=structure.label,
        estimate=found,
        chosen=structure.chosen,
        bandwidth_hz=float(band.hz[0, 0]),
        ci95=(float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0])),
        covers=bool(band.covers(truth.bandwidth_hz)[0, 0]),
        dc_gain=float(found.model.dc_gain()[0, 0]),
        half_power_hz=half_power_hz(found.model),
        fits=fits,
        residual_test=test,
    )


def _fit(found: sysid.Estimate, record: IOData, number: int) -> Fit:
    (score,) = sysid.compare(found, record)
    return Fit(number, float(score.simulation[0]), float(score.one_step[0]))


def _nonparametric(own: IOData) -> tuple[FrequencyResponse, FrequencyResponse]:
    """Spectral and empirical estimates where the periodic input has power: on the lines of the 2 s file.

    Between the lines there is nothing but noise and leakage, and a curve through it would mean nothing.
    """
    lines = np.arange(1, POINTS // 2) * RATE / POINTS
    periods = [own[start : start + POINTS] for start in range(0, len(own) - POINTS + 1, POINTS)]
    return sysid.spa(own, frequencies=lines), sysid.etfe(periods)


def _three_joint_models(joints: Mapping[str, JointResult], truth: Truth) -> tuple[ThreeJointModel, ...]:
    """The SysID model, the OKID model and the hybrid of both [Morris1996, eq. 4.14, 5.11 and sec. VI.6]."""
    columns = [list(truth.model.input_names or ()).index(f"{joint} commanded") for joint in joints]
    true = StateSpace(
        truth.model.A,
        truth.model.B[:, columns],
        truth.model.C[columns],
        truth.model.D[np.ix_(columns, columns)],
        None,
        truth.dt,
    )
    sysid_models = [entry.chosen.estimate.model for entry in joints.values()]
    okid_models = [entry.models["okid"].estimate.model for entry in joints.values()]
    assembled = {
        "SysID model": block_diagonal(sysid_models),
        "OKID model": block_diagonal(okid_models),
        "hybrid model": block_diagonal([sysid_models[0], *okid_models[1:]]),
    }
    return tuple(
        ThreeJointModel(name, model, relative_error(model, true), relative_error(model, true, diagonal=True))
        for name, model in assembled.items()
    )

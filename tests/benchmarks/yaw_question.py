"""What makes a model of the shoulder yaw read 0.13-0.16 Hz with a DC gain above one? Hypotheses, tried on the twin.

Every row is the thesis' PRBS test of 1 V [Morris1996, table 1, test 5], with another sequence and other noise for each
seed, identified with the thesis' own structures: ARMAX 5/3/3 delay 2, OE 2/2 delay 2, OKID of order 2 with p = 5. Of
each model: bandwidth relative to its DC gain, DC gain, and gain at 0.5 Hz, the lowest line of a 100-point file at 50
points per second; medians over the seeds, and the quartiles of ARMAX's.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import cont2discrete, dlsim, lfilter

import sysid
from docs.images.published_servos import YAW_PLANE, coupled
from hmtb_twin import simulate
from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
from hmtb_twin.parameters.values import GAINS, HAND_CONTROLLER, RECORDER, SAMPLE_TIME, HandController
from hmtb_twin.parameters.variants import ACTUATORS, BUS, JOINTS, SERVOS
from scenarios import Scenario, load
from scenarios.experiments.log_review import settled
from scenarios.truth.published import EQUATIONS
from tests.benchmarks.tables import heading, row

JOINT = "shoulder_yaw"
DURATION = 60.0
SEEDS = 4


@dataclass(frozen=True)
class Record:
    """How a record is made.

    `hidden` is what happens to the command, in volts, behind the point where it is logged; `limit_logged` whether the
    velocity limit acts before that point.
    """

    variant: str = "nominal"
    plant: Plant = NOMINAL_PLANT
    hand_controller: HandController = HAND_CONTROLLER
    amplitude: float = 1.0
    clock: int = 2
    repeat: float = 0.5
    hidden: Callable | None = None
    limit_logged: bool = True

    def logged(self, volts):
        """The command at that point, V; the velocity limit of the yaw's command is 25 deg/s."""
        return limited(25.0)(volts) if self.limit_logged else volts


@dataclass(frozen=True)
class Row:
    """A hypothesis: a record, how it is looked at, and what differs in the structures."""

    label: str
    record: Record
    view: Callable = lambda data, seed: data.detrend()
    armax: tuple[int, int, int, int] = (5, 3, 3, 2)
    oe: tuple[int, int, int] = (2, 2, 2)
    group: str = ""


def scaled(volts):
    """The servo gets a multiple of what is logged."""
    return 1.18 * volts


def smoothed(volts):
    """The command passes a first-order low-pass of 1 rad/s behind the log."""
    a = np.exp(-SAMPLE_TIME)
    return lfilter([0.0, 1.0 - a], [1.0, -a], volts, axis=0)


def led(volts):
    """Velocity feedforward: the servo gets the command and its derivative times 50 ms."""
    return volts + 0.05 * np.diff(volts, axis=0, prepend=0.0) / SAMPLE_TIME


def limited(speed):
    """The velocity limit, deg/s, acts behind the log instead of before it."""

    def signal(volts):
        step = np.radians(speed) * SAMPLE_TIME / HAND_CONTROLLER.gain
        passed, last = np.empty_like(volts), np.zeros(volts.shape[1])
        for k, wanted in enumerate(volts):
            last = passed[k] = last + np.clip(wanted - last, -step, step)
        return passed

    return signal


def means_in(data, seed):
    return data


def offset_left_in(data, seed):
    """Both angles from the start pose, the measured one 0.3 mrad off, and no detrending."""
    return data.subtract(u=data.u.mean(axis=0), y=data.y.mean(axis=0) - 3e-4)


def wandering(step):
    """The measured angle wanders: a random walk, rad per sample."""

    def view(data, seed):
        walk = np.cumsum(np.random.default_rng(seed).standard_normal(data.y.shape), axis=0)
        return replace(data, y=data.y + step * walk).detrend()

    return view


def drifting(data, seed):
    """The measured angle drifts in a straight line, by 1.2 mrad from start to end."""
    return replace(data, y=data.y + 1.2e-3 * np.linspace(0.0, 1.0, len(data))[:, None]).detrend()


def backlash(data, seed):
    """Backlash of 1.8 mrad between joint and resolver."""
    shown, last = np.empty_like(data.y), data.y[0]
    for k, angle in enumerate(data.y):
        last = shown[k] = np.clip(last, angle - 9e-4, angle + 9e-4)
    return replace(data, y=shown).detrend()


def integrating(data, seed):
    """A servo with integral action kp/1 s beside its kp and kd: what the same arm, linear, would have measured."""
    A, B = coupled(YAW_PLANE.joints, SERVOS)
    yaw, n = YAW_PLANE.joints.index(JOINT), len(YAW_PLANE.joints)
    push = A[2 * n + yaw, yaw]  # what the integral of q adds to the rate of the torque
    A = np.block([[A, np.zeros((3 * n, 1))], [np.zeros((1, 3 * n + 1))]])
    A[2 * n + yaw, -1], A[-1, yaw] = -push, -1.0
    B = np.append(B[:, yaw], 1.0)[:, None]
    u = data.u - data.u.mean(axis=0)
    _, shown, _ = dlsim(cont2discrete((A, B, np.eye(1, 3 * n + 1, yaw), np.zeros((1, 1))), SAMPLE_TIME), u)
    late = np.vstack([np.zeros((BUS[JOINT].delay, 1)), shown])[: len(u)]
    noise = RECORDER.noise * np.random.default_rng(seed).standard_normal(late.shape)
    return replace(data, u=u, y=late + noise)[round(20.0 / SAMPLE_TIME) :].detrend()


NOMINAL, SLOW = Record(), Record("published")


YAW_FRICTION = (
    100.0 * ACTUATORS["shoulder_yaw"].friction.coulomb
)  # dry friction of the nominal yaw, percent of the maximum torque


def rubbing(percent):
    """The nominal arm with that dry friction of the yaw, percent of the maximum torque."""
    return Record(plant=Plant(friction_level=percent / YAW_FRICTION))


def behind(record, speed):
    """The same with a velocity limit, deg/s, behind the log instead of before it."""
    return replace(record, hidden=limited(speed), limit_logged=False)


def reading(name, percent=YAW_FRICTION):
    """The same with another reading of the hand controller's gain, and perhaps other seals."""
    return replace(rubbing(percent), hand_controller=HandController(gain=GAINS[name]))


WORN = rubbing(1.2)


ROWS = (
    Row("as it is (dry friction 0.6 %)", NOMINAL, group="The nominal arm, truly 1.07 Hz, 4 mrad/V"),
    Row("torque servo", replace(NOMINAL, plant=Plant(servo="torque"))),
    Row("means left in", NOMINAL, means_in),
    Row("zero of the resolver 0.3 mrad off, left in", NOMINAL, offset_left_in),
    Row("output drifts by 1.2 mrad", NOMINAL, drifting),
    Row("output wanders, 0.02 mrad per sample", NOMINAL, wandering(2e-5)),
    Row("output wanders, 0.06 mrad per sample", NOMINAL, wandering(6e-5)),
    Row("valve noise, 0.2 % of maximum torque", replace(NOMINAL, plant=Plant(process_noise=0.002))),
    Row("hand-controller bias 0.5 V", replace(NOMINAL, hand_controller=HandController(bias=0.5))),
    Row("hand controller holds 1 sample, no noise", replace(NOMINAL, hand_controller=HandController(hold=1, noise=0))),
    Row("supply at 6 MPa, which just holds the arm", replace(NOMINAL, plant=Plant(supply_pressure=6.0))),
    Row("servo gets 1.18 times the logged command", replace(NOMINAL, hidden=scaled)),
    Row("integral action, reset time 1 s, torque servo without friction", NOMINAL, integrating),
    Row("velocity feedforward, 50 ms", replace(NOMINAL, hidden=led)),
    *(Row(f"velocity limit behind the log, {speed} deg/s", behind(NOMINAL, speed)) for speed in (6, 3, 1.5, 0.3)),
    Row("command smoothed behind the log, 1 rad/s", replace(NOMINAL, hidden=smoothed)),
    Row("backlash 1.8 mrad", NOMINAL, backlash),
    Row("delay taken as 1", NOMINAL, armax=(5, 3, 3, 1), oe=(2, 2, 1)),
    Row("delay taken as 4", NOMINAL, armax=(5, 3, 3, 4), oe=(2, 2, 4)),
    Row("orders too high: ARMAX 8/8/8, OE 5/5", NOMINAL, armax=(8, 8, 8, 2), oe=(5, 5, 2)),
    Row("the first 8 s only", NOMINAL, lambda data, seed: data[: round(8.0 / SAMPLE_TIME)].detrend()),
    Row("2 V", replace(NOMINAL, amplitude=2.0)),
    Row("file played at 0.05 instead of 0.5 Hz", replace(NOMINAL, repeat=0.05)),
    Row("dry friction 0.1 %", rubbing(0.1), group="Other seals, other readings of the gain"),
    *(Row(f"dry friction {percent} %", rubbing(percent)) for percent in (0.3, 0.9, 1.2, 1.8)),
    Row("dry friction 1.2 %, Coulomb alone", replace(WORN, plant=replace(WORN.plant, friction="coulomb"))),
    Row("dry friction 1.2 %, file played at 0.05 Hz", replace(WORN, repeat=0.05)),
    Row("dry friction 1.2 %, servo gets 1.18 times the logged command", replace(WORN, hidden=scaled)),
    Row("dry friction 1.2 %, velocity limit behind the log, 3 deg/s", behind(WORN, 3.0)),
    Row("dry friction 0.9 %, output drifts by 1.2 mrad", rubbing(0.9), drifting),
    Row("dry friction 0.9 %, output wanders, 0.02 mrad per sample", rubbing(0.9), wandering(2e-5)),
    Row("gain read in degrees, 1.17 mrad/V, dry friction 0.1 %", reading("degrees", 0.1)),
    Row("gain read in radians, 67 mrad/V", reading("radians")),
    *(Row(f"67 mrad/V, dry friction {p} %", reading("radians", p)) for p in (8, 12, 15, 18)),
    Row("67 mrad/V, dry friction 15 %, file played at 0.05 Hz", replace(reading("radians", 15), repeat=0.05)),
    Row("as it is", SLOW, group="The published variant, truly 0.16 Hz with a DC gain of 1.00"),
    Row("means left in", SLOW, means_in),
    Row("valve noise, 0.2 % of maximum torque", replace(SLOW, plant=Plant(process_noise=0.002))),
    Row("output wanders, 0.02 mrad per sample", SLOW, wandering(2e-5)),
    Row("velocity limit behind the log, 1.5 deg/s", behind(SLOW, 1.5)),
)


def scenario(record, seed, duration):
    """The PRBS test as one record wants it."""

    class Hidden(Scenario):
        """An experiment whose servo gets another command than the log shows."""

        def volts(self):
            volts = super().volts()
            return volts if record.hidden is None else record.hidden(record.logged(volts))

    test = load(f"siso-5-{JOINT}")
    (prbs,) = test.excitation
    parameters = {**prbs.parameters, "amplitude": record.amplitude, "clock": record.clock, "seed": seed}
    changed = replace(
        test,
        name=f"record-{seed}",
        seed=1000 + seed,
        duration=duration,
        variant=record.variant,
        plant=record.plant,
        hand_controller=record.hand_controller,
        # What is hidden has its own limit, in front of it or in it.
        chain=replace(test.chain, velocity_limit=record.hidden is None),
        excitation=(replace(prbs, parameters=parameters, repeat_frequency=record.repeat),),
    )
    return Hidden(**vars(changed))


def records(wanted, seeds, duration):
    """Simulate every record with every seed, and cut off its start; the means stay."""
    runs = [(record, scenario(record, seed, duration)) for record in wanted for seed in range(seeds)]
    logs = simulate([run for _, run in runs])
    if logs.failed:
        raise SystemExit(f"failed: {dict(logs.failed)}")
    settled_records = {record: [] for record in wanted}
    for (record, run), log in zip(runs, logs, strict=True):
        data = settled(log, JOINT)
        if record.hidden is not None:
            # A constant apart, which is removed from both angles or is the same in both.
            start = log.commanded[0, JOINTS.index(JOINT)]
            logged = record.logged(Scenario.volts(run))[-len(data) :]
            data = replace(data, u=start + HAND_CONTROLLER.gain * logged)
        settled_records[record].append(data)
    return settled_records


def models(hypothesis, data, seed):
    """The thesis' three models of a record."""
    seen = hypothesis.view(data, seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield sysid.armax(seen, *hypothesis.armax).model
        yield sysid.oe(seen, *hypothesis.oe).model
        yield sysid.okid(seen, 2, p=5).model


def figures(model):
    """Bandwidth in Hz relative to the DC gain, DC gain, gain at the lowest line."""
    at_line = np.abs(model.frequency_response(np.array([0.5]))[0, 0, 0])
    return float(model.bandwidth()[0, 0]), float(model.dc_gain()[0, 0]), float(at_line)


def measured(hypothesis, data):
    """Figures of every seed and method, (seeds, 3, 3)."""
    return np.array([[figures(model) for model in models(hypothesis, one, seed)] for seed, one in enumerate(data)])


def print_row(label, values):
    """Print medians, and ARMAX's quartiles."""

    def gain(value):
        return f"{value:.2f}" if abs(value) < 10.0 else ("large" if value > 0 else "-large")

    cells = []
    for hz, dc, at_line in np.median(values, axis=0):
        # The gain of a model of some seed never falls by 3 dB.
        cells += [f"{hz:.2f}" if np.isfinite(hz) else "none", gain(dc), f"{at_line:.2f}"]
    low, high = np.quantile(values[:, 0], [0.25, 0.75], axis=0)
    spread = (f"{low[0]:.2f}-{high[0]:.2f}", f"{gain(low[1])} to {gain(high[1])}") if len(values) > 1 else ("", "")
    row(label, *cells, *spread)


def main():
    simulated = records(list(dict.fromkeys(entry.record for entry in ROWS)), SEEDS, DURATION)
    methods = (cell for method in ("ARMAX", "OE", "OKID") for cell in (f"{method}, Hz", "DC", "at 0.5 Hz"))
    heading("", *methods, "ARMAX, middle half, Hz", "DC")
    print_row("**printed**", np.array([[figures(EQUATIONS[name].model) for name in ("4.7", "4.8", "5.8")]]))
    for entry in ROWS:
        if entry.group:
            row(f"*{entry.group}*", *[""] * 11)
        print_row(entry.label, measured(entry, simulated[entry.record]))


if __name__ == "__main__":
    main()

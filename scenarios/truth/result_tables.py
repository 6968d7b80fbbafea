"""Tables of the true dynamics and of attainable errors, with the sentences that explain them."""

from collections.abc import Iterable, Mapping

import numpy as np

from hmtb_twin import JointTruth
from hmtb_twin.parameters.quantity import Provenance
from scenarios.files.result_table import ResultTable
from scenarios.truth.attainable import Attainable
from scenarios.truth.best_linear import BestLinearTruth, cautions
from scenarios.truth.truth_summary import (
    LOCKED_NOTE,
    TruthSummary,
    conditions_in_words,
    damping_ratio,
    pose_in_words,
)

MRAD = 1e3


def joint_table(summary: TruthSummary) -> ResultTable:
    """The small-signal truth joint by joint, beside it hydraulic resonances and best linear approximations."""
    truth = summary.truth
    columns = ["joint", "bandwidth\n/ Hz", "gain at 0 Hz\n/ (rad/rad)", "delay\n/ samples", "dominant poles\n/ (rad/s)"]
    columns.append("largest zeros\n(z plane)")
    if summary.hydraulics:
        columns.append("hydraulic resonance\n/ Hz")
    if summary.best_linear:
        columns += ["best linear\n/ Hz (95 %)", "distortion\n/ %"]
    rows = []
    for name, joint in summary.joints.items():
        if name in summary.locked:
            rows.append([name, "locked", *["—"] * (len(columns) - 2)])
            continue
        row = [name, *_dynamics_cells(joint, truth.dt)]
        if summary.hydraulics:
            oil = summary.hydraulics[name]
            row.append(f"{oil.natural_frequency / (2 * np.pi):.1f} (ζ {oil.damping_ratio:.2g})")
        if name in summary.best_linear:
            row += _best_linear_cells(summary.best_linear[name])
        # Only the studied joints have best linear approximations.
        rows.append(row + [""] * (len(columns) - len(row)))
    title = f"Linearised truth of the arm '{truth.variant}' with payload '{truth.payload}', pose {pose_in_words(truth)}"
    return ResultTable(title, columns, rows)


def _dynamics_cells(joint: JointTruth, dt: float) -> list[str]:
    """Bandwidth, gain at 0 Hz, delay, dominant poles and largest zeros of a joint."""
    # Poles above the Nyquist frequency are aliases at the sampling rate of the bus.
    below_nyquist = [pole for pole in joint.dominant_poles if abs(pole) < np.pi / dt]
    poles = _first_roots(below_nyquist, digits=1, count=4, with_damping=True)
    zeros = _first_roots(joint.zeros, digits=2, count=3) or "none"
    return [f"{joint.bandwidth_hz:.3f}", f"{joint.dc_gain:.4f}", str(joint.delay_samples), poles, zeros]


def _best_linear_cells(approximation: BestLinearTruth) -> list[str]:
    """Bandwidth with its interval, and distortion."""
    hz, low, high = approximation.bandwidth.path()
    bandwidth = f"{hz:.3f} ({low:.3f}..{high:.3f})" if np.isfinite(hz) else "none shows"
    return [bandwidth, f"{approximation.distortion_percent[0]:.1f}"]


def _first_roots(roots: Iterable[complex], *, digits: int, count: int, with_damping: bool = False) -> str:
    """The first few poles or zeros, each conjugate pair once."""
    texts = []
    for root in roots:
        if abs(root.imag) <= 1e-6 * abs(root):  # an eigenvalue solver leaves rounding in the imaginary part
            texts.append(f"{root.real:.{digits}f}")
        elif root.imag > 0.0:
            damping = f" (ζ {damping_ratio(root):.2f})" if with_damping else ""
            texts.append(f"{root.real:.{digits}f}±{root.imag:.{digits}f}j{damping}")
    rest = ", ..." if len(texts) > count else ""
    return ", ".join(texts[:count]) + rest


def joint_notes(summary: TruthSummary) -> list[str]:
    """Locked joints, conditions, errors of the linear model, noise, and how the best linear ones were measured."""
    notes = [f"{name}: {LOCKED_NOTE}" for name in sorted(summary.locked)]
    notes.append(f"Conditions: {conditions_in_words(summary.arm)}")
    if summary.arm.friction:
        exception = " but for the best linear ones" if summary.best_linear else "; see --bla 0.01"
        notes.append(f"Dry friction is not in these numbers{exception}")
    errors = summary.truth.small_signal_error.items()
    listed = ", ".join(f"{error:.1e} at {amplitude:g} rad" for amplitude, error in errors)
    notes.append(f"Relative error of the linear model against the simulated arm (friction off): {listed}")
    notes += _assumed_notes(summary)
    if summary.truth.plant.process_noise:
        notes.append(_innovations_note(summary))
    if summary.best_linear:
        notes += _best_linear_notes(summary)
    return notes


def _assumed_notes(summary: TruthSummary) -> list[str]:
    """What is assumed of an arm, by a rule or by its own files; nothing of the arms of the test bed."""
    arm = summary.arm.description
    by_parameter: dict[tuple[str, str], list[Provenance]] = {}
    for row in arm.assumed:
        by_parameter.setdefault((row.parameter, row.source), []).append(row)
    notes = []
    if by_parameter:
        # A file of the test bed says itself that its numbers are assumed.
        why = "as its files say" if arm.links else "as its files do not say it; an arm.toml beside them would"
        notes.append(f"Assumed of {arm.name}, {why}:")
    for (parameter, source), rows in by_parameter.items():
        # Most rules give each joint a number of its own.
        values = ", ".join(dict.fromkeys(map(_number, rows)))
        owners = [row.owner for row in rows]
        joints = "all joints" if set(owners) == set(arm.joints) else ", ".join(owners)
        unit = "" if rows[0].unit == "1" else f" {rows[0].unit}"
        notes.append(f"  {parameter} of {joints}: {values}{unit} ({source})")
    return notes + [f"Read from its files: {remark}" for remark in arm.remarks]


def _number(row: Provenance) -> str:
    """A number of a description in three digits, or the sides of a box."""
    sides = row.value if isinstance(row.value, tuple) else (row.value,)
    return " x ".join(f"{side:.3g}" for side in sides)


def _innovations_note(summary: TruthSummary) -> str:
    deviations = []
    for name, joint in summary.joints.items():
        covariance = joint.model.innovation_covariance
        if name not in summary.locked and covariance is not None:
            deviations.append(f"{name} {MRAD * float(np.sqrt(covariance[0, 0])):.4f}")
    listed = ", ".join(deviations)
    return f"Standard deviation of each joint's innovations / mrad: {listed} (K and covariance: --json)"


def _best_linear_notes(summary: TruthSummary) -> list[str]:
    """How the best linear approximations were measured, and where they say little."""
    multisines = next(iter(summary.best_linear.values())).experiment.multisines
    counts = []
    for name, approximation in summary.best_linear.items():
        counts.append(f"{approximation.experiment.multisines.realisations} of {name}")
    notes = [
        f"Best linear: {multisines.rms:g} rad rms, {multisines.f_min:g} to {multisines.f_max:g} Hz, each joint alone, "
        f"as many realisations as its interval needs, {', '.join(counts)}; friction, velocity limit and noise on"
    ]
    for name, approximation in summary.best_linear.items():
        remarks = cautions(approximation, summary.truth)
        if remarks:
            notes.append(f"{name}: its best linear bandwidth has little meaning: {'; '.join(remarks)}")
    return notes


def attainable_table(attainable: Mapping[str, Attainable]) -> ResultTable:
    """The smallest errors that models of several classes can reach on a record."""
    rows = []
    for name, limit in attainable.items():
        for label, horizon in (("simulation", limit.simulation), ("one step", limit.one_step)):
            # The searches for systems of the truth's order are for simulations alone.
            of_true_order = limit.right_order if label == "simulation" else None
            cells = []
            for floor in (horizon.any_model, horizon.best_linear, of_true_order, horizon.small_signal):
                cells.append(f"{floor.fit:.2f} % ({MRAD * floor.rmse:.3f})" if floor else "—")
            rows.append([name, label, *cells])
    record = next(iter(attainable.values())).provenance["record"]
    columns = ("joint", "horizon", "any model", "best linear", "of the truth's order", "small-signal truth")
    return ResultTable(f"Attainable on {record}: fit (RMSE / mrad)", columns, rows)


def attainable_notes(attainable: Mapping[str, Attainable]) -> list[str]:
    """What chance adds to attainable errors, and what they are the least of."""
    first = next(iter(attainable.values()))
    notes = [
        f"Chance: on {first.samples} samples, at most one model in twenty that is as good as a limit has an RMSE more "
        f"than {100 * (1 - first.by_chance(1.0)):.2g} % below it (more where the model is fitted to this record)",
        "Best linear: the least of pulse responses, ARX models and models of the truth's order that are fitted to this "
        "record's noise-free angles, the initial state free; linear systems of other classes may do better",
    ]
    averaged = [f"{name} {MRAD * limit.mean_error:.3f}" for name, limit in attainable.items() if limit.mean_error]
    if averaged:
        notes.append(
            f"Noise-free angles are means over draws of process noise; standard error / mrad: {', '.join(averaged)}"
        )
    return notes

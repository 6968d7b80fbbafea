"""Report section on the seven-joint model: variables of its template, its figure and its record in the results."""

import numpy as np

from hmtb_twin import JOINTS
from scenarios.identification.every_joint import FLOOR, LEVEL, MULTISINES, SevenJoints
from scenarios.report.chart import Chart, Panel, Series
from scenarios.report.figure_style import MRAD, short
from scenarios.thesis.comparison import Comparison
from sysid.plots import PALETTE, Style

LEAST = 1e-4
"""Lower end of the logarithmic axis of gains, on which zero has no place: intervals that reach zero end there."""


def every_joint_section(study: Comparison) -> dict[str, object]:
    """Template variables of the section on the seven-joint model; none where the study has no such model."""
    seven = study.every_joint
    if seven is None:
        return {}
    multisines = seven.approximation.experiment.multisines
    inside_interval = [path for path in seven.paths if path.hz[1] <= path.truth.bandwidth_hz <= path.hz[2]]
    return {
        "paths": seven.paths,
        "held": len(inside_interval),
        "multisines": multisines,
        "whole": multisines.realisations == MULTISINES.realisations,
        "records": multisines.realisations * len(JOINTS),
        "rms": _range(MRAD * seven.approximation.command_rms),
        "distortion": _range(seven.approximation.distortion_percent),
        **_coupling_counts(seven),
        "level": 100.0 * LEVEL,
        "floor": FLOOR,
    }


def _range(values: np.ndarray) -> list[float]:
    """Smallest and largest value."""
    return [float(values.min()), float(values.max())]


def _coupling_counts(seven: SevenJoints) -> dict[str, object]:
    """Count the paths from one joint to another that couple by the truth, and the verdicts on them that are wrong."""
    missed = []
    for measured, commanded in np.argwhere(seven.coupled & ~seven.significant):
        gain = float(seven.true_gain[measured, commanded])
        missed.append((short(JOINTS[commanded]), short(JOINTS[measured]), gain))
    return {
        # Every joint responds to its own command: the diagonal is no coupling.
        "coupled": int(seven.coupled.sum()) - len(JOINTS),
        "uncoupled": int((~seven.coupled).sum()),
        "false": int((seven.significant & ~seven.coupled).sum()),
        "missed": missed,
    }


def every_joint(study: Comparison) -> Chart:
    """Gain of every path over the band, with intervals, and what is significant, beside the small-signal truth."""
    seven = study.every_joint
    if seven is None:
        return Chart({})
    panels = tuple(_measured_joint_panel(seven, measured) for measured in range(len(JOINTS)))
    return Chart({("",): panels}, ("",), columns=2, height=230)


def _measured_joint_panel(seven: SevenJoints, measured: int) -> Panel:
    """Gains from every command to one measured joint, by its number."""
    # An axis counts its names from below: reversed, the first joint stands at the top.
    upward = slice(None, None, -1)
    commanded_joints = [short(joint) for joint in JOINTS][upward]
    significant = seven.significant[measured]

    def gain_series(label: str, style: Style, shown: np.ndarray) -> Series:
        """Estimated gains with intervals of the paths that are shown; the others are NaN, which is not drawn."""
        bounds = (seven.coupling.gain, seven.coupling.low, seven.coupling.high)
        gain, low, high = (np.where(shown, np.maximum(bound[measured], LEAST), np.nan)[upward] for bound in bounds)
        return Series(label, gain, commanded_joints, style, low, high, along=True)

    true_gain = np.where(seven.coupled[measured], seven.true_gain[measured], np.nan)[upward]
    truth_style = Style(PALETTE["truth"].colour, "", 1.0, "D")
    significant_style = Style(PALETTE["arx"].colour, "", 1.0, "s")
    other_style = Style(PALETTE["measured"].colour, "", 1.0, "x")
    series = [
        Series("small-signal truth", true_gain, commanded_joints, truth_style),
        gain_series(f"significant at {100 * LEVEL:g} %, 95 % interval", significant_style, significant),
        gain_series("not significant", other_style, ~significant),
    ]
    return Panel("gain", "command to", series, f"{short(JOINTS[measured])} moves", "x", (LEAST, 1.0))


def every_joint_record(study: Comparison) -> dict[str, object] | None:
    """The seven-joint model for `results.json`; rows are measured, columns commanded joints."""
    seven = study.every_joint
    if seven is None:
        return None
    joints: dict[str, dict[str, object]] = {}
    for path in seven.paths:
        joints[path.truth.name] = {
            "true_hz": path.truth.bandwidth_hz,
            "hz": path.hz[0],
            "ci95": path.hz[1:],
            "bare_hz": path.bare[0],
            "bare_ci95": path.bare[1:],
            "delay": path.delay,
            "true_delay": path.truth.delay_samples,
        }
    estimated = {name: getattr(seven.coupling, name).tolist() for name in ("gain", "low", "high", "p")}
    judged = {name: getattr(seven, name).tolist() for name in ("true_gain", "coupled", "significant")}
    return {"joints": joints, "coupling": {"level": LEVEL, **estimated, **judged}}

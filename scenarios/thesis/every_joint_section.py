"""Report section on the seven-joint model: its variables, its figure and its numbers in the results."""

import numpy as np

from hmtb_twin import JOINTS
from scenarios.identification.every_joint import FLOOR, LEVEL, MULTISINES
from scenarios.report.figure_style import MRAD, short
from scenarios.thesis.chart import Chart, Panel, Series
from scenarios.thesis.comparison import Comparison
from sysid.plots import PALETTE, Style

LEAST = 1e-4
"""Lower end of the axis of gains: intervals that reach zero end there."""


def every_joint_section(study: Comparison) -> dict[str, object]:
    """Variables of the template of this section; none where the study has no seven-joint model."""
    seven = study.every_joint
    if seven is None:
        return {}
    whole, called = seven.approximation, seven.significant
    multisines = whole.experiment.multisines
    return {
        "paths": seven.paths,
        "held": sum(path.hz[1] <= path.truth.bandwidth_hz <= path.hz[2] for path in seven.paths),
        "multisines": multisines,
        "whole": multisines.realisations == MULTISINES.realisations,
        "records": multisines.realisations * len(JOINTS),
        "rms": [float(end) for end in (MRAD * whole.command_rms.min(), MRAD * whole.command_rms.max())],
        "distortion": [float(whole.distortion_percent.min()), float(whole.distortion_percent.max())],
        "coupled": int(seven.coupled.sum()) - len(JOINTS),
        "uncoupled": int((~seven.coupled).sum()),
        "false": int((called & ~seven.coupled).sum()),
        # Commanded, moved, true gain over the band.
        "missed": [
            (short(JOINTS[j]), short(JOINTS[i]), float(seven.true_gain[i, j]))
            for i, j in np.argwhere(seven.coupled & ~called)
        ],
        "level": 100.0 * LEVEL,
        "floor": FLOOR,
    }


def every_joint(study: Comparison) -> Chart:
    """Gain of every path over the band, with intervals, and what is significant, beside the small-signal truth."""
    seven = study.every_joint
    if seven is None:
        return Chart({})
    # An axis counts its names from below.
    names, upward, panels = [short(joint) for joint in JOINTS], slice(None, None, -1), []
    kinds = (
        (f"significant at {100 * LEVEL:g} %, 95 % interval", Style(PALETTE["arx"].colour, "", 1.0, "s"), True),
        ("not significant", Style(PALETTE["measured"].colour, "", 1.0, "x"), False),
    )
    for i, moved in enumerate(names):
        true = np.where(seven.coupled[i], seven.true_gain[i], np.nan)[upward]
        series = [Series("small-signal truth", true, names[upward], Style(PALETTE["truth"].colour, "", 1.0, "D"))]
        for label, style, wanted in kinds:
            gain, low, high = (
                np.where(seven.significant[i] == wanted, np.maximum(values[i], LEAST), np.nan)[upward]
                for values in (seven.coupling.gain, seven.coupling.low, seven.coupling.high)
            )
            series.append(Series(label, gain, names[upward], style, low, high, along=True))
        panels.append(Panel("gain", "command to", series, f"{moved} moves", "x", (LEAST, 1.0)))
    return Chart({("",): tuple(panels)}, ("",), columns=2, height=230)


def every_joint_record(study: Comparison) -> dict[str, object] | None:
    """The seven-joint model for `results.json`; rows are measured, columns commanded joints."""
    seven = study.every_joint
    if seven is None:
        return None
    return {
        "joints": {
            path.truth.name: {
                "true_hz": path.truth.bandwidth_hz,
                "hz": path.hz[0],
                "ci95": path.hz[1:],
                "bare_hz": path.bare[0],
                "bare_ci95": path.bare[1:],
                "delay": path.delay,
                "true_delay": path.truth.delay_samples,
            }
            for path in seven.paths
        },
        "coupling": {
            "level": LEVEL,
            **{name: getattr(seven.coupling, name).tolist() for name in ("gain", "low", "high", "p")},
            **{name: getattr(seven, name).tolist() for name in ("true_gain", "coupled", "significant")},
        },
    }

"""The printed models in the report: what they are, what is doubtful, and how they follow the twin's records."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, SEVERAL_JOINTS
from scenarios.files.errors import MissingRecordError
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.report.figure_style import short
from scenarios.report.figures import Gallery
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figures_chapter_5 import printed_outputs
from scenarios.truth.published import (
    DRAWS,
    PUBLISHED,
    SYSTEMS,
    YAW_ARMAX_BOTH,
    YAW_ARMAX_STATE_SPACE,
    DigitRange,
    PublishedModel,
    digit_range,
)
from sysid import IOData, SysidWarning

SHOWN = (5, 4)
"""Single-joint tests that are drawn: PRBS, two sines."""


@dataclass(frozen=True)
class PrintedFit:
    """Fit of a printed model to a record of the twin.

    Attributes:
        simulation: Fit in simulation, percent.
        one_step: Fit one step ahead with the printed gain, percent.
    """

    simulation: float
    one_step: float


@dataclass(frozen=True, eq=False)
class PrintedRow:
    """A printed model in the table.

    Attributes:
        printed: The model.
        digits: What its rounding leaves open.
        near: Whether its bandwidth is about 1 Hz.
        observer: Largest modulus of the eigenvalues of A - K C: below one where it can predict.
        singles: Fits to the single-joint tests of its joint, by number.
        several: Fits on its joint to the records of several joints, by name.
    """

    printed: PublishedModel
    digits: DigitRange
    near: bool
    observer: float
    singles: dict[int, PrintedFit]
    several: dict[str, PrintedFit]


def published_section(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    records = several_records(study)
    rows = [printed_row(study, entry, records) for entry in (*PUBLISHED, YAW_ARMAX_BOTH)]
    rows.sort(key=lambda row: (STUDIED_JOINTS.index(row.printed.joint), row.printed.method))
    # Second prints of one model lie on each other; the first is drawn.
    drawn = [row.printed for row in rows if row.printed not in (YAW_ARMAX_STATE_SPACE, YAW_ARMAX_BOTH)]
    return {
        "rows": rows,
        "records": list(records),
        "draws": DRAWS,
        "systems": SYSTEMS,
        "figures": [
            gallery.add(
                printed_outputs(
                    study.joints[joint].data[number],
                    {
                        printed: sysid.compare(printed.model, study.joints[joint].data[number])[0]
                        for printed in drawn
                        if printed.joint == joint
                    },
                    f"{short(joint)}, test {number}",
                    length=4.0 if number == SHOWN[0] else 2.0,
                ),
                f"{short(joint)}: the printed models simulated on the twin's command of test {number}, with their fits "
                "over the whole record. They were identified from the real arm, so the twin owes them nothing.",
                name=f"published-{number}-{joint.replace('_', '-')}",
            )
            for joint in study.joints
            for number in SHOWN
            if number in study.joints[joint].data
        ],
    }


def printed_row(study: Comparison, printed: PublishedModel, records: dict[str, IOData]) -> PrintedRow:
    """Section of the report on one printed model.

    Args:
        study: The study.
        printed: The model.
        records: Records of several joints, as `several_records` returns them.

    Returns:
        The row.
    """
    singles = study.joints[printed.joint].data
    k = STUDIED_JOINTS.index(printed.joint)
    return PrintedRow(
        printed=printed,
        digits=digit_range(printed.name),
        near=near_1_hz(printed.bandwidth_hz),
        observer=float(np.abs(np.roots(printed.noise_polynomial)).max(initial=0.0)),
        singles={number: _fit(printed, data) for number, data in singles.items()},
        several={name: _fit(printed, data.select(inputs=[k], outputs=[k])) for name, data in records.items()},
    )


def several_records(study: Comparison, names: Sequence[str] | None = None) -> dict[str, IOData]:
    """Records of the studied joints together, those that there are: table 2, then the exchange."""
    found: dict[str, IOData] = {}
    for name in names or (*(f"mimo-{number}" for number in SEVERAL_JOINTS), RPCM):
        try:
            found[name] = study.campaign.several(name)
        except MissingRecordError:
            continue
    return found


def _fit(printed: PublishedModel, data: IOData) -> PrintedFit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        (fit,) = sysid.compare(printed.model, data)
    return PrintedFit(float(fit.simulation[0]), float(fit.one_step[0]))

"""Report section on chapters II and III: tables of records and nonparametric estimates."""

from dataclasses import dataclass
from math import degrees

from hmtb_twin.parameters.values import HAND_CONTROLLER, MOTIONS
from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.registry import load
from scenarios.report.figure_style import MRAD
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.nonparametric import RecordSummary
from sysid.models.bandwidth import half_power_hz


@dataclass(frozen=True)
class Row:
    """A test in the table of all records.

    Attributes:
        name: Number of the test or name of the scenario.
        said: What is played.
        cells: What its record of each joint says; None where there is none.
    """

    name: str
    said: str
    cells: tuple[RecordSummary | None, ...]


def chapter_3(study: Comparison) -> dict[str, object]:
    """Numbers of the chapter.

    Args:
        study: The study.

    Returns:
        Variables of the template.
    """
    return {
        "limit": degrees(max(MOTIONS[joint].velocity_limit for joint in study.joints)),
        "gain": MRAD * HAND_CONTROLLER.gain,
        "slewing": 100 * max(share for entry in study.joints.values() for share in entry.slewing.values()),
        "numbered": _waveforms_by_number(study),
        "single": _single(study),
        "several": _several(study),
        "true": [half_power_hz(entry.truth.model) for entry in study.joints.values()],
    }


def _waveforms_by_number(study: Comparison) -> list[tuple[int, str]]:
    """Test numbers with the waveform each test plays."""
    joint, entry = next(iter(study.joints.items()))
    return [(number, load(single_joint_test(number, joint)).description.split(": ", 1)[1]) for number in entry.data]


def _single(study: Comparison) -> list[Row]:
    """Table rows of the single-joint tests."""
    return [
        Row(
            str(number),
            text,
            tuple(
                estimates.tests.get(single_joint_test(number, joint))
                for joint, estimates in study.nonparametric.items()
            ),
        )
        for number, text in _waveforms_by_number(study)
    ]


def _several(study: Comparison) -> list[Row]:
    """Table rows of the tests of several joints."""
    return [
        Row(
            name.removeprefix("mimo-").replace("-independent", ", independent"),
            load(name).description.split(": ", 1)[1],
            tuple(estimates.tests.get(name) for estimates in study.nonparametric.values()),
        )
        for name in study.campaign.logs
        if name.startswith("mimo-")
    ]

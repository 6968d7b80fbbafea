"""Report section on chapters II and III: waveforms, records and nonparametric estimates."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.registry import load
from scenarios.report.figure_style import short
from scenarios.report.figures import Gallery, Picture
from scenarios.thesis import figures_chapter_3 as draw
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.figures_waveforms import waveform, waveform_figures
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES, RecordSummary
from sysid.models.bandwidth import half_power_hz

THESIS: Mapping[str, Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "shoulder_yaw": {
            "sines": ("20", "21", "31", "32"),
            "transfer": ("22",),
            "prbs": ("23", "24"),
            "correlations": ("25",),
            "pulse": ("26",),
            "pulse spectra": ("27", "28", "29", "30"),
            "sines spectra": ("33", "34", "35", "36"),
        },
        "shoulder_pitch": {
            "sines": ("A1", "A11"),
            "transfer": ("A2",),
            "prbs": ("A3",),
            "correlations": ("A4",),
            "pulse": ("A5", "A6"),
            "pulse spectra": ("A7", "A8", "A9", "A10"),
            "sines spectra": ("A12", "A13", "A14", "A15"),
        },
        "elbow_pitch": {
            "sines": ("A16", "A25"),
            "transfer": ("A17",),
            "prbs": ("A18",),
            "correlations": ("A19",),
            "pulse": ("A20",),
            "pulse spectra": ("A21", "A22", "A23", "A24"),
            "sines spectra": ("A26", "A27", "A28", "A29"),
        },
    }
)
"""Numbers of the thesis figures by joint, with their content."""


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


def chapter_3(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the chapter.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    waveforms = [
        gallery.add(waveform(entry.files), entry.caption, name=f"waveform-{name}", thesis=entry.thesis)
        for name, entry in waveform_figures().items()
    ]
    # Records first, what is made of them after: figures are numbered as they come on the page.
    data = [_records(study, entry, gallery) for entry in study.joints.values()]
    analyses = [_analyses(study, entry, gallery) for entry in study.joints.values()]
    return {
        "waveforms": waveforms,
        "joints": data,
        "analyses": analyses,
        "numbered": _waveforms_by_number(study),
        "single": _single(study),
        "several": _several(study),
        "true": [half_power_hz(entry.truth.model) for entry in study.joints.values()],
    }


def _records(study: Comparison, entry: JointResult, gallery: Gallery) -> dict[str, object]:
    name, mark, figures = short(entry.joint), entry.joint.replace("_", "-"), THESIS[entry.joint]
    pictures = [
        gallery.add(
            draw.tests(study, entry),
            f"{name}: two settled seconds of each test, commanded and measured angle about their means.",
            name=f"tests-{mark}",
        )
    ]
    captions = {
        SINES: ("sines", "the two sines at 2.5 and 10 Hz", 0.8),
        PRBS: ("prbs", "the PRBS of 1 V", 2.0),
        PULSE: ("pulse", "the bipolar ramping pulse", 2.0),
    }
    for number, (key, what, length) in captions.items():
        if number in entry.data:
            pictures.append(
                gallery.add(
                    draw.record(study.campaign.log(single_joint_test(number, entry.joint)), entry.joint, length=length),
                    f"{name}, {what}, angles from the operating point: the whole record as the band between least and "
                    "greatest; magnified; below, what command and measurement read at one instant of each period, in "
                    "the steps of the hand controller's converter and of the resolver.",
                    name=f"record-{key}-{mark}",
                    thesis=figures[key],
                )
            )
    return {"result": entry, "figures": pictures}


def _analyses(study: Comparison, entry: JointResult, gallery: Gallery) -> dict[str, object]:
    name, mark, figures = short(entry.joint), entry.joint.replace("_", "-"), THESIS[entry.joint]
    estimates = study.nonparametric[entry.joint]
    pictures: list[Picture] = []
    if SINES in estimates.spectra:
        pictures.append(
            gallery.add(
                draw.transfer_function(entry, estimates),
                f"{name}: the transfer function as the thesis estimates it, cross over input spectrum of the two "
                f"sines, Hamming window, lag {estimates.lags[SINES]}. Only below the arrowheads has the input more "
                f"power "
                "than the window leaks: its phase is drawn there alone, and gaps are where the windowed input spectrum "
                "is negative. A Parzen window of the same lag leaks less. Beside them the lines on which repetition "
                "tells the gain to a fifth, the excited lines of the PRBS, and the truth.",
                name=f"transfer-function-{mark}",
                thesis=figures["transfer"],
            )
        )
    pictures.append(
        gallery.add(
            draw.correlation(study, entry, estimates),
            f"{name}: correlations of the PRBS test, each divided by the sizes of its signals. Left as recorded, right "
            "with both signals filtered so that the command is white. Below: where output and white input begin to "
            "correlate, and the pulse response that follows.",
            name=f"correlations-{mark}",
            thesis=figures["correlations"],
        )
    )
    for number, key, what in (
        (PULSE, "pulse spectra", "the bipolar ramping pulse"),
        (SINES, "sines spectra", "the two sines at 2.5 and 10 Hz"),
    ):
        if number in estimates.spectra:
            pictures.append(
                gallery.add(
                    draw.four_spectra(study, entry, estimates, number),
                    f"{name}, {what}: two-sided spectra of disturbance, output and input and between both, by the "
                    "thesis' Hamming window (gaps: negative) and by repetition. Circles: what the truth answers to the "
                    "input on its lines. Black: what is measured beyond that answer, noise at the floor, friction on "
                    "the lines. Repetition counts a little more at the lowest frequencies: what noise on the command "
                    "did before a block began.",
                    name=f"spectra-{key.split()[0]}-{mark}",
                    thesis=figures[key],
                )
            )
    pictures.append(
        gallery.add(
            draw.data_spectra(study, entry),
            f"{name}: input, output and disturbance spectra on the lines of the PRBS; the disturbance is what "
            "differs between periods.",
            name=f"spectra-{mark}",
        )
    )
    return {"result": entry, "figures": pictures}


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

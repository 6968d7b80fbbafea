"""Chapter V in the report: OKID."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.report.figure_style import short
from scenarios.report.figures import Gallery
from scenarios.thesis import figures_chapter_5 as draw
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.observer_analysis import LIVE, JointObserver, P, described
from scenarios.thesis.wording import p_value
from scenarios.truth.published import PERCENT_DESCRIBED, PublishedModel
from sysid import StateSpace

FIRST = {"shoulder_yaw": ("", 50), "shoulder_pitch": ("A", 52), "elbow_pitch": ("A", 58)}
"""First of the thesis' six figures of each joint."""


@dataclass(frozen=True)
class Quantity:
    """A row of the table of realisations.

    Attributes:
        name: What it is.
        ours: Its value in the model of the study.
        printed: Its value in the printed model.
        coordinates: Whether it depends on the coordinates of the state, so that the two cannot be compared.
    """

    name: str
    ours: str
    printed: str
    coordinates: bool


def chapter_5(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    found = study.observers
    return {
        "p": P,
        "live": 100 * LIVE,
        "printed_percent": PERCENT_DESCRIBED,
        "joints": [
            {
                "result": entry,
                "observer": found.joints[joint],
                "whiteness": p_value(found.joints[joint].test.whiteness_p[0]),
                "realisation": realisation(entry, found.joints[joint]),
                "figures": _figures(study, joint, gallery),
                "records": [{"row": row, "white": p_value(row.whiteness_p)} for row in found.records.get(joint, ())],
            }
            for joint, entry in study.joints.items()
        ],
        "several": found.several,
    }


def realisation(entry: JointResult, observer: JointObserver) -> tuple[Quantity, ...]:
    """The model of the study beside the printed one: matrices, and what does not depend on coordinates."""
    printed = next(one for one in entry.published if one.method == "okid")
    ours = observer.estimate.model
    pairs = [
        ("A", _matrix(ours.A), _matrix(printed.model.A), True),
        ("B", _matrix(ours.B.T), _matrix(printed.model.B.T), True),
        ("C", _matrix(ours.C), _matrix(printed.model.C), True),
        ("D", _matrix(ours.D), _matrix(printed.model.D), False),
        ("G", _matrix(-ours.gain.T), _matrix(-printed.model.gain.T), True),
        ("CB, CAB", _markov(ours), _markov(printed.model), False),
        ("poles", _roots(ours.poles()), _roots(printed.model.poles()), False),
        ("zeros", _roots(ours.zeros()), _roots(printed.model.zeros()), False),
        ("eigenvalues of A + G C", _roots(observer.observer_poles), _roots(_observer_poles(printed)), False),
        ("gain at 0 Hz", f"{ours.dc_gain()[0, 0]:.4f}", f"{printed.dc_gain:.4f}", False),
        ("bandwidth, Hz", f"{float(ours.bandwidth()[0, 0]):.3f}", f"{printed.bandwidth_hz:.3f}", False),
        (
            "described by two states, %",
            f"{described(observer.estimate, ours.order):.4f}",
            f"{PERCENT_DESCRIBED[entry.joint]:.4f}",
            False,
        ),
    ]
    return tuple(Quantity(*pair) for pair in pairs)


def _figures(study: Comparison, joint: str, gallery: Gallery) -> list[object]:
    entry, observer, name, mark = (
        study.joints[joint],
        study.observers.joints[joint],
        short(joint),
        joint.replace("_", "-"),
    )
    letter, first = FIRST[joint]
    system, own = observer.live
    drawn: list[object] = [
        gallery.add(
            draw.markov_parameters(observer),
            f"{name}: above the Markov parameters of the observer, {P} of the command and {P} of the measurement; the "
            f"last one above {100 * LIVE:g} % of the largest comes {own} samples after the pulse. Below those of the "
            f"system that follow from them, with the last one after {system - 1} samples, beside those of the truth.",
            name=f"markov-{mark}",
            thesis=(f"{letter}{first}",),
        )
    ]
    if observer.errors:
        drawn.append(
            gallery.add(
                draw.errors(observer),
                f"{name}: what observers with p Markov parameters leave of the output, standard deviation over that of "
                "the output. The thesis does not define its smoothing error; here it is that of the best estimate from "
                "both sides.",
                name=f"observer-errors-{mark}",
                thesis=(f"{letter}{first + 1}",),
            )
        )
    drawn += [
        gallery.add(
            draw.hankel(observer),
            f"{name}: Hankel singular values of the system’s Markov parameters. There are {P}, because {P} observer "
            "parameters make a recursion of that order.",
            name=f"hankel-{mark}",
            thesis=(f"{letter}{first + 2}",),
        ),
        gallery.add(
            draw.state_space_bode(entry),
            f"{name}: frequency response of the OKID model with its 95 % band, of the truth and of the printed OKID "
            "model.",
            name=f"bode-okid-{mark}",
            thesis=(f"{letter}{first + 3}",),
        ),
        gallery.add(
            draw.predicted(entry.data[study.estimation_test], observer.own, f"{name}, PRBS", length=4.0),
            f"{name}: predicted and simulated output against the PRBS record that the model was identified from, with "
            "fits over the whole record.",
            name=f"predicted-{mark}",
            thesis=(f"{letter}{first + 4}",),
        ),
    ]
    if observer.chirp is not None:
        drawn.append(
            gallery.add(
                draw.predicted(entry.data[8], observer.chirp, f"{name}, chirp from 5 to 10 Hz", length=2.0),
                f"{name}: cross-validation on the 5–10 Hz chirp, one sweep.",
                name=f"chirp-{mark}",
                thesis=(f"{letter}{first + 5}",),
            )
        )
    return drawn


def _observer_poles(printed: PublishedModel) -> np.ndarray:
    values = np.linalg.eigvals(printed.model.A - printed.model.gain @ printed.model.C).astype(complex)
    return values[np.argsort(-np.abs(values), kind="stable")]


def _markov(model: StateSpace) -> str:
    return ", ".join(f"{value:.5f}" for value in model.markov(3)[1:, 0, 0])


def _matrix(values: np.ndarray) -> str:
    """Rows apart by semicolons, five digits as the thesis has."""
    return "; ".join(" ".join(f"{value:.5g}" for value in row) for row in np.atleast_2d(values))


def _roots(roots: Sequence[complex] | np.ndarray) -> str:
    shown = []
    for value in np.asarray(roots, dtype=complex):
        if abs(value.imag) < 5e-4:
            shown.append(f"{value.real:.3f}")
        elif value.imag > 0:
            shown.append(f"{value.real:.3f} ± {value.imag:.3f}j")
    return ", ".join(shown) or "none"

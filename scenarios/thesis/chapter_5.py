"""Report section on chapter V: tables of observer/Kalman identification."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.number_text import p_value
from scenarios.thesis.observer_analysis import JointObserver, P, hankel_share, observer_poles
from scenarios.truth.published import PERCENT_DESCRIBED
from sysid import StateSpace


@dataclass(frozen=True)
class Quantity:
    """A row of the table of realisations.

    Attributes:
        name: What it is.
        ours: Its value in the model of the study.
        printed: Its value in the printed model.
    """

    name: str
    ours: str
    printed: str


def chapter_5(study: Comparison) -> dict[str, object]:
    """Numbers of the section.

    Args:
        study: The study.

    Returns:
        Variables of the template.
    """
    return {
        "p": P,
        "printed_percent": PERCENT_DESCRIBED,
        "joints": [
            {
                "result": entry,
                "observer": study.observers[joint],
                "whiteness": p_value(entry.models["okid"].residual_test.whiteness_p[0]),
                "realisation": realisation(entry, study.observers[joint]),
            }
            for joint, entry in study.joints.items()
        ],
    }


def realisation(entry: JointResult, observer: JointObserver) -> tuple[Quantity, ...]:
    """The identified and the printed model: matrices and coordinate-free quantities."""
    printed = next(model for model in entry.published if model.method == "okid")
    ours = observer.estimate.model
    pairs = [
        ("A", _matrix(ours.A), _matrix(printed.model.A)),
        ("B", _matrix(ours.B.T), _matrix(printed.model.B.T)),
        ("C", _matrix(ours.C), _matrix(printed.model.C)),
        ("D", _matrix(ours.D), _matrix(printed.model.D)),
        ("G", _matrix(-ours.gain.T), _matrix(-printed.model.gain.T)),
        ("CB, CAB", _markov(ours), _markov(printed.model)),
        ("poles", _roots(ours.poles()), _roots(printed.model.poles())),
        ("zeros", _roots(ours.zeros()), _roots(printed.model.zeros())),
        ("eigenvalues of A + G C", _roots(observer_poles(ours)), _roots(observer_poles(printed.model))),
        ("gain at 0 Hz", f"{ours.dc_gain()[0, 0]:.4f}", f"{printed.dc_gain:.4f}"),
        ("bandwidth, Hz", f"{float(ours.bandwidth()[0, 0]):.3f}", f"{printed.bandwidth_hz:.3f}"),
        (
            "described by two states, %",
            f"{hankel_share(observer.estimate, ours.order):.4f}",
            f"{PERCENT_DESCRIBED[entry.joint]:.4f}",
        ),
    ]
    return tuple(Quantity(*pair) for pair in pairs)


def _markov(model: StateSpace) -> str:
    return ", ".join(f"{value:.5f}" for value in model.markov(3)[1:, 0, 0])


def _matrix(values: np.ndarray) -> str:
    """Matrix as text: rows separated by semicolons, five digits as in the thesis."""
    return "; ".join(" ".join(f"{value:.5g}" for value in row) for row in np.atleast_2d(values))


def _roots(roots: Sequence[complex] | np.ndarray) -> str:
    parts = []
    for value in np.asarray(roots, dtype=complex):
        if abs(value.imag) < 5e-4:
            parts.append(f"{value.real:.3f}")
        elif value.imag > 0:
            parts.append(f"{value.real:.3f} ± {value.imag:.3f}j")
    return ", ".join(parts) or "none"

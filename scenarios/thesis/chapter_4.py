"""Chapter IV in the report: prediction-error models."""

from dataclasses import dataclass

import numpy as np

from scenarios.experiments.campaign import single_joint_test, tests_of_same_sequence
from scenarios.report.figure_style import short
from scenarios.report.figures import Gallery, Picture
from scenarios.thesis import figures_chapter_4 as draw
from scenarios.thesis import figures_data_sets as draw_sets
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.every_data_set import AUDIBLE, DataSets, distances
from scenarios.thesis.order_search import IMPROVES, Searches
from scenarios.thesis.wording import p_value
from sysid import StateSpace

FIGURES = {"shoulder_yaw": ("", 39), "shoulder_pitch": ("A", 30), "elbow_pitch": ("A", 41)}
"""First of the thesis' eleven figures of each joint: five of ARMAX, five of OE, one Bode plot."""

PIECES = {5: 4.0, 4: 1.6, 7: 3.0, 8: 2.0}
"""Tests whose outputs are drawn, and how much of each, s."""

SAID = {
    5: "the PRBS that they were identified from",
    4: "the two sines at 2.5 and 10 Hz",
    7: "the bipolar ramping pulse",
    8: "the 5-10 Hz chirp",
}


@dataclass(frozen=True)
class Coefficients:
    """A model in the form of the thesis' prints.

    Attributes:
        label: Its name.
        rows: Power of 1/z, then its coefficient in the denominator, in the numerator, and K.
        printed: Whether the thesis prints it.
    """

    label: str
    rows: tuple[tuple[int, float, float, float], ...]
    printed: bool


def chapter_4(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the chapter.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    return {
        "joints": [_joint(study, joint, gallery) for joint in study.joints],
        "seen": tests_of_same_sequence(study.estimation_test),
        "audible": 100 * AUDIBLE,
        "improves": IMPROVES,
        "p_value": p_value,
        "thorough": bool(study.searches),
    }


def _joint(study: Comparison, joint: str, gallery: Gallery) -> dict[str, object]:
    entry, sets, found = study.joints[joint], study.data_sets[joint], study.searches.get(joint)
    arx = sets.find(single_joint_test(study.estimation_test, joint), "arx")
    name, mark = short(joint), joint.replace("_", "-")
    armax, oe = ([_figure(joint, number) for number in range(first, first + 5)] for first in (0, 5))
    return {
        "result": entry,
        "bode": gallery.add(
            draw.model_bode(entry),
            f"{name}: frequency response of the truth, of spectral and empirical estimate on the excited lines "
            "and of the identified models, with 95 % bands. Dashed: −3 dB below one; dotted: 1 Hz; grey: "
            "nothing is excited there, models extrapolate.",
            name=f"bode-{mark}",
        ),
        "zoom": gallery.add(
            draw.zoomed_bode(entry),
            f"{name}: the gain from 0.1 to 3 Hz; below, by how much it departs from the true gain.",
            name=f"bode-zoom-{mark}",
        ),
        "published": gallery.add(
            draw.published_bode(entry),
            f"{name}: the models that the thesis prints, beside the truth of the twin. Grey: below 0.5 Hz, "
            "where the PRBS file of the twin excites nothing; that of the thesis is not known.",
            name=f"bode-published-{mark}",
        ),
        "kinds": gallery.add(
            draw.kinds_bode(entry, arx.model if arx else None),
            f"{name}: ARMAX, ARX and OE from the PRBS, beside the truth and what the thesis prints of these kinds.",
            name=f"bode-kinds-{mark}",
            thesis=(_figure(joint, 10),),
        ),
        "sequences": gallery.add(
            draw.residual_sequences(entry, ("armax", "oe")),
            f"{name}: residuals of ARMAX and OE on the PRBS over the whole record, one step ahead, on one scale.",
            name=f"residual-sequences-{mark}",
            thesis=(armax[0], oe[0]),
        ),
        "residuals": [
            gallery.add(
                draw.residuals(model),
                f"{name}, {model.label}: correlations of the residuals on the PRBS test with 99 % bounds "
                f"(whiteness {p_value(model.residual_test.whiteness_p[0])}, independence "
                f"{p_value(model.residual_test.independence_p[0, 0])}).",
                name=f"residuals-{method.replace('_', '-')}-{mark}",
                thesis=thesis,
            )
            for method, thesis in (("armax", (armax[1],)), ("oe", (oe[1],)), ("oe_high", ()))
            if (model := entry.models[method])
        ],
        "roots": [
            gallery.add(
                draw.roots(entry, method),
                f"{name}, {entry.models[method].label}: poles and zeros in the z plane with their 95 % regions and the "
                "unit circle, beside those of the truth and of the printed model of this kind where there is one.",
                name=f"roots-{method}-{mark}",
                thesis=(thesis[2],),
            )
            for method, thesis in (("armax", armax), ("oe", oe))
        ],
        "outputs": [
            gallery.add(
                draw.outputs(entry, number, length=length),
                f"{name}: simulated outputs of the models against the measurement of test {number}, "
                f"{SAID[number]}, with their fits over the whole record; below, what is left.",
                name=f"outputs-{number}-{mark}",
                thesis={5: (armax[3], oe[3]), 4: (armax[4], oe[4])}.get(number, ()),
            )
            for number, length in PIECES.items()
            if number in entry.data
        ],
        "coefficients": coefficients(entry),
        "sets": sets,
        "shown": {record: draw_sets.shown(record, sets) for record in sets.excited},
        "apart": {method: _apart(sets, method) for method in draw_sets.METHODS},
        "bandwidths": gallery.add(
            draw_sets.bandwidths(entry, sets),
            f"{name}: bandwidth from every data set by every structure, with 95 % intervals; arrows: beyond the axis. "
            "Intervals know of noise alone, not of friction and the velocity limit, which differ from test to test.",
            name=f"data-sets-bandwidth-{mark}",
        ),
        "responses": gallery.add(
            draw_sets.responses(entry, sets),
            f"{name}: gain of the models from every single-joint data set that excites enough, over that of the "
            "small-signal truth: how far the data sets agree, structure by structure.",
            name=f"data-sets-gain-{mark}",
        ),
        "search": found,
        "searches": _searches(found, name, mark, gallery) if found else (),
        "criteria": {name: found.arx.best(name) for name in ("aic", "bic", "mdl", "validation")} if found else {},
        "more_poles": study.prediction_errors[joint].more_poles,
    }


def _searches(found: Searches, name: str, mark: str, gallery: Gallery) -> tuple[Picture, ...]:
    return (
        gallery.add(
            draw_sets.searches(found),
            f"{name}: the search for orders, upwards from one pole. Above, how the models follow the tests of other "
            "waveforms in simulation (what lies far below is left out); below, how many of 25 lags of the residuals' "
            "autocorrelation lie outside the 99 % bounds (white: none or one). Ring: chosen; star: the thesis' orders.",
            name=f"order-search-{mark}",
        ),
        gallery.add(
            draw_sets.arx_orders(found),
            f"{name}: criteria of every ARX structure over its number of parameters; validation on the tests of "
            "other waveforms.",
            name=f"order-criteria-{mark}",
        ),
    )


def _figure(joint: str, number: int) -> str:
    letter, first = FIGURES[joint]
    return f"{letter}{first + number}"


def _apart(sets: DataSets, method: str) -> dict[str, float]:
    models = sets.singles(method, enough=True)
    pairs = distances(models)
    return {
        "models": len(models),
        "unstable": sum(not model.stable for model in models),
        "median": float(np.median(pairs)) if len(pairs) else np.nan,
        "largest": float(pairs.max()) if len(pairs) else np.nan,
    }


def coefficients(entry: JointResult) -> tuple[Coefficients, ...]:
    """ARMAX and OE of the study and the printed ones of these kinds, coefficient by coefficient."""
    ours = [
        Coefficients(entry.models[method].label, _observer_form(entry.models[method].estimate.model), False)
        for method in ("armax", "oe")
    ]
    printed = [
        Coefficients(f"published {model.label}", _observer_form(model.model), True)
        for model in entry.published
        if model.method in ("armax", "oe")
    ]
    return (*ours, *printed)


def _observer_form(model: StateSpace) -> tuple[tuple[int, float, float, float], ...]:
    """Coefficients of a model in observer companion form, as our estimates and the prints are [Morris1996, eq. 4.9]."""
    return tuple(
        (k + 1, -float(model.A[k, 0]), float(model.B[k, 0]), float(model.gain[k, 0])) for k in range(model.order)
    )

"""The seven categories in which the thesis compares its two models, each with numbers [Morris1996, sec. VI.6]."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median

import numpy as np

from scenarios.experiments.campaign import RPCM
from scenarios.thesis.campaign import plays_identified_sequence
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import AS_IT_IS
from scenarios.thesis.findings_chapter_6 import FAST, FOLLOWS
from scenarios.thesis.multivariable import WAYS, ThreeJointModel, Way
from scenarios.thesis.verdicts import MARGIN, WORDS, ahead
from sysid import IOData, residuals

SAME = 0.1
"""A disturbed record gives a comparable model if the bandwidth changes by no more than this fraction."""

DRAW = "neither"
"""The better of two methods where both meet a requirement, or both do the same."""


@dataclass(frozen=True)
class Measure:
    """One number for each model.

    Attributes:
        what: What is measured, with its unit.
        values: By name of the model.
        ahead: `SysID`, `OKID` or `neither`, of the two identified from the twin.
        printed_ahead: The same of the two as printed; nothing where the digits do not tell.
        digits: Decimals that say something.
    """

    what: str
    values: Mapping[str, float]
    ahead: str
    printed_ahead: str = ""
    digits: int = 1

    def text(self, name: str) -> str:
        """The number of a model as text; a dash where it has none."""
        value = self.values.get(name, float("nan"))
        return f"{value:.{self.digits}f}" if np.isfinite(value) else "–"


@dataclass(frozen=True)
class Category:
    """One of the seven categories.

    Attributes:
        name: As the thesis calls it.
        thesis: Who is ahead there.
        measures: The numbers; none where the study has not tried it.
    """

    name: str
    thesis: str
    measures: tuple[Measure, ...]

    @property
    def ahead(self) -> str:
        """Method that is ahead on the twin by all measures, or a note that it depends on the measure."""
        leaders = {entry.ahead for entry in self.measures}
        if len(leaders) == 1:
            return leaders.pop()
        return "depends on the measure" if leaders else "not tried"


def categories(study: Comparison) -> tuple[Category, ...]:
    """Compute the measures of all seven categories, in the thesis' order."""
    return (
        Category("frequency bandwidth", "OKID, slightly, above 5 Hz", _bandwidth(study)),
        Category("model stability", "neither: both stable", _stability(study)),
        Category("flexibility", "SysID", _flexibility(study)),
        Category("parsimony", "OKID", _parsimony(study)),
        Category("robustness", "SysID", _robustness(study)),
        Category("RPCM fit", "OKID", _exchange(study)),
        Category("MIMO data fits", "OKID, on most; SysID on yaw at low frequency", _several(study)),
    )


def _measure(
    what: str,
    study: Comparison,
    of: Callable[[ThreeJointModel], float],
    *,
    more: bool,
    printed: bool = True,
    digits: int = 1,
    margin: float = 0.0,
) -> Measure:
    """A number for every model; the larger is ahead if more is better and the difference is no tie."""
    values = {entry.name: of(entry) for entry in study.multivariable.models if printed or not entry.printed}
    return Measure(
        what,
        values,
        _better(values["SysID model"], values["OKID model"], more, margin),
        _better(values["printed SysID model"], values["printed OKID model"], more, margin) if printed else "",
        digits,
    )


def _better(own: float, okid: float, more: bool, margin: float = 0.0) -> str:
    if own == okid or np.isnan(own) or np.isnan(okid) or abs(own - okid) < margin:
        return DRAW
    return "SysID" if (own > okid) == more else "OKID"


def _bandwidth(study: Comparison) -> tuple[Measure, ...]:
    truth = {joint: entry.best_linear.hz for joint, entry in study.joints.items()}

    def bandwidth_error(entry: ThreeJointModel) -> float:
        return float(
            np.mean([abs(100 * (block.bandwidth()[0, 0] / truth[joint] - 1)) for joint, block in entry.blocks.items()])
        )

    measures = [
        _measure("bandwidth off the best linear truth, mean over the joints, %", study, bandwidth_error, more=False)
    ]
    fast = [name for name in FAST[1] if name in study.multivariable.records]
    if fast:
        measures += [
            _measure(
                f"fit above 5 Hz {WORDS[way]}, median of {len(fast)} records, mean over the joints, %",
                study,
                lambda entry, way=way: median(entry.fit(name).mean(way) for name in fast),  # type: ignore[misc]
                more=True,
                margin=MARGIN,
            )
            for way in WAYS
        ]
    return tuple(measures)


def _stability(study: Comparison) -> tuple[Measure, ...]:
    measure = _measure("largest modulus of a pole", study, lambda entry: entry.largest_pole, more=False, digits=3)

    def verdict(own: str, okid: str) -> str:
        stable = [measure.values[name] < 1.0 for name in (own, okid)]
        return DRAW if stable[0] == stable[1] else ("SysID" if stable[0] else "OKID")

    return (
        Measure(
            f"{measure.what} (truth {_slowest(study):.3f})",
            measure.values,
            verdict("SysID model", "OKID model"),
            verdict("printed SysID model", "printed OKID model"),
            3,
        ),
    )


def _slowest(study: Comparison) -> float:
    """Largest modulus of a pole of the three joints' true responses."""
    return max(float(np.abs(entry.truth.model.poles()).max()) for entry in study.joints.values())


def _flexibility(study: Comparison) -> tuple[Measure, ...]:
    """Count the combinations of structures and data sets that lead to an accepted model.

    Accepted is a model that is stable and follows its own record better than `FOLLOWS` in simulation.
    """
    accepted: dict[bool, list[str]] = {False: [], True: []}
    single: list[str] = []
    for entry in study.data_sets.values():
        single += entry.single
        for model in entry.singles():
            if model.stable and model.own.simulation > FOLLOWS:
                accepted[model.structure.method == "okid"].append(model.record)
    prbs = f"siso-{study.estimation_test}-"
    structures = [sum(record.startswith(prbs) for record in accepted[okid]) for okid in (False, True)]
    whole = [len(set(accepted[okid])) for okid in (False, True)]
    return tuple(
        Measure(what, {"SysID model": float(a), "OKID model": float(b)}, _better(a, b, True), digits=0)
        for what, (a, b) in (
            ("accepted structures from the PRBS test, three joints", structures),
            (f"single-joint data sets with an accepted model, of {len(single)}", whole),
        )
    )


def _parsimony(study: Comparison) -> tuple[Measure, ...]:
    states = _measure("states", study, lambda entry: float(entry.model.order), more=False, digits=0)
    information = {
        name: sum(
            _aic(study.joints[joint].data[study.estimation_test], study, joint, name == "OKID model")
            for joint in study.joints
        )
        for name in ("SysID model", "OKID model")
    }
    least = min(information.values())
    return (
        states,
        Measure(
            "Akaike's criterion on the data of estimation above the smaller, three joints",
            {name: value - least for name, value in information.items()},
            _better(information["SysID model"], information["OKID model"], False),
            digits=0,
        ),
        *(
            _measure(
                f"fit {WORDS[way]} per state, mean over joints and records of other waveforms, %",
                study,
                lambda entry, way=way: _mean_fit(entry, way) / entry.model.order,  # type: ignore[misc]
                more=True,
            )
            for way in WAYS
        ),
    )


def _aic(data: IOData, study: Comparison, joint: str, okid: bool) -> float:
    """N log V + 2 d of the one-step errors [Ljung1999, sec. 16.4]; d = 3 n + 1 for OKID's A, B, D and K in n states."""
    entry = study.joints[joint]
    model = entry.models["okid"].estimate if okid else entry.chosen.estimate
    count = 3 * model.model.order + 1 if okid else len(model.parameters)
    errors = residuals(model, data)
    return float(len(errors) * np.log(np.mean(errors**2)) + 2 * count)


def _mean_fit(entry: ThreeJointModel, way: Way) -> float:
    means = [fits.mean(way) for name, fits in entry.fits.items() if not plays_identified_sequence(name)]
    return float(np.mean(means)) if means else float("nan")


def _robustness(study: Comparison) -> tuple[Measure, ...]:
    """Share of disturbed records whose model keeps the bandwidth of the model from the undisturbed record."""
    results = study.robustness
    measures = []
    for disturbance in ("bias", "outliers"):
        counts = {}
        for name, okid in (("SysID model", False), ("OKID model", True)):
            mine = [
                entry
                for entry in results.outcomes
                if entry.chosen and (entry.method == "okid") == okid and entry.treatment == AS_IT_IS[0]
            ]
            plain = {e.joint: e.bandwidth_hz for e in mine if e.disturbance == "bias" and e.degree == 0.0}
            disturbed = [e for e in mine if e.disturbance == disturbance and e.degree > 0.0 and e.joint in plain]
            same = [abs(e.bandwidth_hz / plain[e.joint] - 1) <= SAME for e in disturbed]
            counts[name] = 100 * float(np.mean(same)) if same else float("nan")
        measures.append(
            Measure(
                f"records spoilt by {disturbance} that move the bandwidth by up to {100 * SAME:.0f} %, %",
                counts,
                _better(counts["SysID model"], counts["OKID model"], True),
                digits=0,
            )
        )
    return tuple(measures)


def _exchange(study: Comparison) -> tuple[Measure, ...]:
    if RPCM not in study.multivariable.records:
        return ()
    return tuple(
        _measure(
            f"fit {WORDS[way]}, mean over the joints, %",
            study,
            lambda entry, way=way: entry.fit(RPCM).mean(way),  # type: ignore[misc]
            more=True,
            digits=2,
            margin=MARGIN,
        )
        for way in WAYS
    )


def _several(study: Comparison) -> tuple[Measure, ...]:
    """Number of held-out records on which each of two models fits better; ties and the hybrid model do not count."""
    records = [name for name in study.multivariable.records if name != RPCM and not plays_identified_sequence(name)]
    measures = []
    for way in WAYS:
        values: dict[str, float] = {}
        for printed in (False, True):
            own, okid = study.multivariable.pair(printed=printed)
            lead = [own.fit(name).mean(way) - okid.fit(name).mean(way) for name in records]
            values[own.name], values[okid.name] = (float(sum(ahead(sign * v) for v in lead)) for sign in (1, -1))
        measures.append(
            Measure(
                f"records of {len(records)} of other waveforms that it follows better by {MARGIN:g} points "
                f"{WORDS[way]}, mean "
                "over the joints",
                values,
                _better(values["SysID model"], values["OKID model"], True),
                _better(values["printed SysID model"], values["printed OKID model"], True),
                0,
            )
        )
    return tuple(measures)

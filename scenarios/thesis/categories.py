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
from sysid import Estimate, IOData, residuals

SAME = 0.1
"""A disturbed record gives a comparable model if the bandwidth changes by no more than this fraction."""

DRAW = "neither"
"""The better of two methods where both meet a requirement, or both do the same."""


@dataclass(frozen=True)
class Measure:
    """A quantity with its unit, and its value for each model by name.

    The larger (`more`) or the smaller is ahead, by what is `compared` of it; differences below `margin` are ties.
    """

    what: str
    values: Mapping[str, float]
    more: bool
    digits: int = 1
    margin: float = 0.0
    compared: Callable[[float], float] = float

    @property
    def ahead(self) -> str:
        """`SysID`, `OKID` or `neither`, of the two identified from the twin."""
        return self._leader("")

    @property
    def printed_ahead(self) -> str:
        """The same of the two as printed; empty without numbers for them."""
        return self._leader("printed ") if "printed SysID model" in self.values else ""

    def _leader(self, kind: str) -> str:
        own, okid = (self.compared(self.values[f"{kind}{name} model"]) for name in ("SysID", "OKID"))
        if own == okid or np.isnan(own) or np.isnan(okid) or abs(own - okid) < self.margin:
            return DRAW
        return "SysID" if (own > okid) == self.more else "OKID"

    def text(self, name: str) -> str:
        """The number of a model as text; a dash where it has none."""
        value = self.values.get(name, float("nan"))
        return f"{value:.{self.digits}f}" if np.isfinite(value) else "–"


@dataclass(frozen=True)
class Category:
    """One of the seven categories, with who is ahead in the thesis, and its measures if the study has tried it."""

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


def _of_models(study: Comparison, number: Callable[[ThreeJointModel], float]) -> dict[str, float]:
    return {entry.name: number(entry) for entry in study.multivariable.models}


def _both_ways(
    study: Comparison, what: str, number: Callable[[ThreeJointModel, Way], float], *, digits: int = 1, margin: float = 0
) -> tuple[Measure, ...]:
    """Measures of the fit in simulation and one step ahead, whose words stand for `{way}`."""
    values = {way: {entry.name: number(entry, way) for entry in study.multivariable.models} for way in WAYS}
    return tuple(
        Measure(what.format(way=WORDS[way]), values[way], more=True, digits=digits, margin=margin) for way in WAYS
    )


def _bandwidth(study: Comparison) -> tuple[Measure, ...]:
    def error(entry: ThreeJointModel) -> float:
        true = {joint: study.joints[joint].best_linear.hz for joint in entry.blocks}
        off = [abs(100 * (block.bandwidth()[0, 0] / true[joint] - 1)) for joint, block in entry.blocks.items()]
        return float(np.mean(off))

    off = Measure("bandwidth off the best linear truth, mean over the joints, %", _of_models(study, error), more=False)
    fast = [name for name in FAST[1] if name in study.multivariable.records]
    if not fast:
        return (off,)
    what = f"fit above 5 Hz {{way}}, median of {len(fast)} records, mean over the joints, %"
    return off, *_both_ways(study, what, lambda e, way: median(e.fit(name).mean(way) for name in fast), margin=MARGIN)


def _stability(study: Comparison) -> tuple[Measure, ...]:
    """Largest modulus of a pole: a stable model is ahead of an unstable one, two stable ones are level."""
    slowest = max(float(np.abs(entry.truth.model.poles()).max()) for entry in study.joints.values())
    what = f"largest modulus of a pole (truth {slowest:.3f})"
    values = _of_models(study, lambda entry: entry.largest_pole)
    return (Measure(what, values, more=False, digits=3, compared=lambda modulus: float(modulus >= 1.0)),)


def _flexibility(study: Comparison) -> tuple[Measure, ...]:
    """Count the combinations of structures and data sets that lead to an accepted model.

    Accepted is a model that is stable and follows its own record better than `FOLLOWS` in simulation.
    """
    accepted: dict[str, list[str]] = {"SysID model": [], "OKID model": []}
    for entry in study.data_sets.values():
        for model in entry.singles():
            if model.stable and model.own.simulation > FOLLOWS:
                accepted["OKID model" if model.method == "okid" else "SysID model"].append(model.record)
    prbs, single = f"siso-{study.estimation_test}-", sum(len(entry.single) for entry in study.data_sets.values())
    structures = {name: float(sum(one.startswith(prbs) for one in records)) for name, records in accepted.items()}
    whole = {name: float(len(set(records))) for name, records in accepted.items()}
    return (
        Measure("accepted structures from the PRBS test, three joints", structures, more=True, digits=0),
        Measure(f"single-joint data sets with an accepted model, of {single}", whole, more=True, digits=0),
    )


def _parsimony(study: Comparison) -> tuple[Measure, ...]:
    information = {"SysID model": 0.0, "OKID model": 0.0}
    for entry in study.joints.values():
        for name, model in (("SysID model", entry.chosen), ("OKID model", entry.models["okid"])):
            information[name] += _aic(model.estimate, entry.data[study.estimation_test])
    above = {name: value - min(information.values()) for name, value in information.items()}
    what = "fit {way} per state, mean over joints and records of other waveforms, %"
    return (
        Measure("states", _of_models(study, lambda entry: float(entry.model.order)), more=False, digits=0),
        Measure(
            "Akaike's criterion on the data of estimation above the smaller, three joints", above, more=False, digits=0
        ),
        *_both_ways(study, what, lambda entry, way: _mean_fit(entry, way) / entry.model.order),
    )


def _aic(model: Estimate, data: IOData) -> float:
    """N log V + 2 d of the one-step errors [Ljung1999, sec. 16.4]; d = 3 n + 1 for OKID's A, B, D and K in n states."""
    count = 3 * model.model.order + 1 if model.method == "okid" else len(model.parameters)
    errors = residuals(model, data)
    return float(len(errors) * np.log(np.mean(errors**2)) + 2 * count)


def _mean_fit(entry: ThreeJointModel, way: Way) -> float:
    means = [fits.mean(way) for name, fits in entry.fits.items() if not plays_identified_sequence(name)]
    return float(np.mean(means)) if means else float("nan")


def _robustness(study: Comparison) -> tuple[Measure, ...]:
    """Share of disturbed records whose model keeps the bandwidth of the model from the undisturbed record."""
    chosen = [entry for entry in study.robustness.outcomes if entry.chosen and entry.treatment == AS_IT_IS[0]]
    measures = []
    for disturbance in ("bias", "outliers"):
        shares = {}
        for name in ("SysID model", "OKID model"):
            mine = [entry for entry in chosen if (entry.method == "okid") == (name == "OKID model")]
            plain = {e.joint: e.bandwidth_hz for e in mine if e.disturbance == "bias" and e.degree == 0.0}
            disturbed = [e for e in mine if e.disturbance == disturbance and e.degree > 0.0 and e.joint in plain]
            same = [abs(e.bandwidth_hz / plain[e.joint] - 1) <= SAME for e in disturbed]
            shares[name] = 100 * float(np.mean(same)) if same else float("nan")
        what = f"records spoilt by {disturbance} that move the bandwidth by up to {100 * SAME:.0f} %, %"
        measures.append(Measure(what, shares, more=True, digits=0))
    return tuple(measures)


def _exchange(study: Comparison) -> tuple[Measure, ...]:
    if RPCM not in study.multivariable.records:
        return ()
    what = "fit {way}, mean over the joints, %"
    return _both_ways(study, what, lambda entry, way: entry.fit(RPCM).mean(way), digits=2, margin=MARGIN)


def _several(study: Comparison) -> tuple[Measure, ...]:
    """Number of held-out records on which each of two models fits better; ties and the hybrid model do not count."""
    records = [name for name in study.multivariable.records if name != RPCM and not plays_identified_sequence(name)]
    measures = []
    for way in WAYS:
        values: dict[str, float] = {}
        for own, okid in (study.multivariable.pair(printed=printed) for printed in (False, True)):
            lead = [own.fit(name).mean(way) - okid.fit(name).mean(way) for name in records]
            values[own.name], values[okid.name] = (float(sum(ahead(sign * v) for v in lead)) for sign in (1, -1))
        what = (
            f"records of {len(records)} of other waveforms that it follows better by {MARGIN:g} points {WORDS[way]}, "
            "mean over the joints"
        )
        measures.append(Measure(what, values, more=True, digits=0))
    return tuple(measures)

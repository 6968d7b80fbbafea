"""The thesis' seven categories of comparison of its SysID and OKID models, in numbers [Morris1996, sec. VI.6]."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from scenarios.experiments.campaign import RPCM
from scenarios.thesis.campaign import plays_identified_sequence
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import AS_IT_IS
from scenarios.thesis.findings_chapter_6 import FAST, FOLLOWS
from scenarios.thesis.multivariable import WAYS, ThreeJointModel, Way
from scenarios.thesis.robustness import RobustnessOutcome
from scenarios.thesis.verdicts import MARGIN, WORDS, ahead
from sysid import Estimate, IOData, residuals

SAME = 0.1
"""A disturbed record gives a comparable model if the bandwidth changes by no more than this fraction."""

SYSID, OKID = "SysID model", "OKID model"
"""Names of the two models of three joints that were identified from the twin; those as printed begin with "printed"."""

DRAW = "neither"
"""Which of two models is ahead where both meet a requirement, or do equally well."""


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
        """Which of the two models identified from the twin is ahead: `SysID`, `OKID` or `neither`."""
        return self._leader("")

    @property
    def printed_ahead(self) -> str:
        """Which of the two models as printed is ahead; empty without numbers for them."""
        prefix = "printed "
        return self._leader(prefix) if prefix + SYSID in self.values else ""

    def _leader(self, prefix: str) -> str:
        """Who is ahead of the two models whose names begin with a prefix."""
        sysid = self.compared(self.values[prefix + SYSID])
        okid = self.compared(self.values[prefix + OKID])
        # Without a margin, equal values are a tie too; a value that is missing puts nobody ahead.
        if sysid == okid or np.isnan(sysid) or np.isnan(okid) or abs(sysid - okid) < self.margin:
            return DRAW
        if self.more:
            return "SysID" if sysid > okid else "OKID"
        return "SysID" if sysid < okid else "OKID"

    def text(self, name: str) -> str:
        """The number of a model as text; a dash where it has none."""
        value = self.values.get(name, float("nan"))
        return f"{value:.{self.digits}f}" if np.isfinite(value) else "–"


@dataclass(frozen=True)
class Category:
    """One of the seven categories, with the model that the thesis prefers, and its measures if the study tried it."""

    name: str
    thesis: str
    measures: tuple[Measure, ...]

    @property
    def ahead(self) -> str:
        """Method that is ahead on the twin by all measures, or a note that it depends on the measure."""
        leaders = {measure.ahead for measure in self.measures}
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
        Category("RPCM fit", "OKID", _exchange_fit(study)),
        Category("MIMO data fits", "OKID, on most; SysID on yaw at low frequency", _records_followed_better(study)),
    )


def _by_model(study: Comparison, quantity: Callable[[ThreeJointModel], float]) -> dict[str, float]:
    """A quantity of every model of three joints, by name."""
    return {model.name: quantity(model) for model in study.multivariable.models}


def _fit_measures(
    study: Comparison,
    label: str,
    quantity: Callable[[ThreeJointModel, Way], float],
    *,
    digits: int = 1,
    margin: float = 0,
) -> tuple[Measure, ...]:
    """Measures of the fit in simulation and one step ahead, whose words stand for `{way}` in the label."""
    measures = []
    for way in WAYS:
        values = {model.name: quantity(model, way) for model in study.multivariable.models}
        measures.append(Measure(label.format(way=WORDS[way]), values, more=True, digits=digits, margin=margin))
    return tuple(measures)


def _bandwidth(study: Comparison) -> tuple[Measure, ...]:
    """Error of the bandwidth, and the fit to records above 5 Hz, where the study has any."""

    def bandwidth_error(model: ThreeJointModel) -> float:
        errors = []
        for joint, block in model.blocks.items():
            # With friction in it, as the records have: no linear model of them can find the small-signal truth.
            true_hz = study.joints[joint].best_linear.hz
            errors.append(abs(100 * (block.bandwidth()[0, 0] / true_hz - 1)))
        return float(np.mean(errors))

    def fast_fit(model: ThreeJointModel, way: Way) -> float:
        return median(model.fit(name).mean(way) for name in fast_records)

    label = "bandwidth off the best linear truth, mean over the joints, %"
    error = Measure(label, _by_model(study, bandwidth_error), more=False)
    _, fast_tests = FAST
    fast_records = [name for name in fast_tests if name in study.multivariable.records]
    if not fast_records:
        return (error,)
    label = f"fit above 5 Hz {{way}}, median of {len(fast_records)} records, mean over the joints, %"
    return error, *_fit_measures(study, label, fast_fit, margin=MARGIN)


def _stability(study: Comparison) -> tuple[Measure, ...]:
    """Largest modulus of a pole: a stable model is ahead of an unstable one, two stable ones are level."""
    slowest = max(float(np.abs(joint.truth.model.poles()).max()) for joint in study.joints.values())
    label = f"largest modulus of a pole (truth {slowest:.3f})"
    values = _by_model(study, lambda model: model.largest_pole)
    # Only the side of the unit circle is compared: a stable model with a slower pole is no worse.
    return (Measure(label, values, more=False, digits=3, compared=lambda modulus: float(modulus >= 1.0)),)


def _model_name(method: str) -> str:
    """Name of the model of three joints that a method of single joints belongs to; all but OKID are SysID's."""
    return OKID if method == "okid" else SYSID


def _flexibility(study: Comparison) -> tuple[Measure, ...]:
    """Count the combinations of structures and data sets that lead to an accepted model.

    Accepted is a model that is stable and follows its own record better than `FOLLOWS` in simulation.
    """
    accepted_records: dict[str, list[str]] = {SYSID: [], OKID: []}
    single_joint_records = 0
    for data_sets in study.data_sets.values():
        single_joint_records += len(data_sets.single)
        for model in data_sets.singles():
            if model.stable and model.own.simulation > FOLLOWS:
                accepted_records[_model_name(model.method)].append(model.record)

    prbs_record = f"siso-{study.estimation_test}-"
    structures: dict[str, float] = {}
    data_set_count: dict[str, float] = {}
    for name, records in accepted_records.items():
        structures[name] = float(sum(record.startswith(prbs_record) for record in records))
        # Several structures may have an accepted model from the same record.
        data_set_count[name] = float(len(set(records)))
    label = f"single-joint data sets with an accepted model, of {single_joint_records}"
    return (
        Measure("accepted structures from the PRBS test, three joints", structures, more=True, digits=0),
        Measure(label, data_set_count, more=True, digits=0),
    )


def _parsimony(study: Comparison) -> tuple[Measure, ...]:
    """Number of states, Akaike's criterion, and the fit per state."""
    criterion = {SYSID: 0.0, OKID: 0.0}
    for joint in study.joints.values():
        record = joint.data[study.estimation_test]
        criterion[SYSID] += _aic(joint.chosen.estimate, record)
        criterion[OKID] += _aic(joint.models["okid"].estimate, record)
    # Differences alone have a meaning: the criterion itself depends on the units of the output.
    smaller = min(criterion.values())
    above_smaller = {name: value - smaller for name, value in criterion.items()}

    # The thesis counts states alone [Morris1996, sec. VI.6]; the other measures weigh them against the fit.
    states = _by_model(study, lambda model: float(model.model.order))
    aic_label = "Akaike's criterion on the data of estimation above the smaller, three joints"
    fit_label = "fit {way} per state, mean over joints and records of other waveforms, %"
    return (
        Measure("states", states, more=False, digits=0),
        Measure(aic_label, above_smaller, more=False, digits=0),
        *_fit_measures(study, fit_label, lambda model, way: _mean_fit(model, way) / model.model.order),
    )


def _aic(model: Estimate, data: IOData) -> float:
    """N log V + 2 d of the one-step errors [Ljung1999, sec. 16.4]; d = 3 n + 1 for OKID's A, B, D and K in n states."""
    # In coordinates that fix C, n states have n parameters of A, n of B, n of K and one of D.
    count = 3 * model.model.order + 1 if model.method == "okid" else len(model.parameters)
    errors = residuals(model, data)
    return float(len(errors) * np.log(np.mean(errors**2)) + 2 * count)


def _mean_fit(model: ThreeJointModel, way: Way) -> float:
    """Mean fit over the joints and the records of other waveforms, percent; NaN without such records."""
    means = [fits.mean(way) for name, fits in model.fits.items() if not plays_identified_sequence(name)]
    return float(np.mean(means)) if means else float("nan")


def _robustness(study: Comparison) -> tuple[Measure, ...]:
    """Share of disturbed records whose model keeps the bandwidth of the model from the undisturbed record."""
    outcomes: dict[str, list[RobustnessOutcome]] = {SYSID: [], OKID: []}
    for outcome in study.robustness.outcomes:
        if outcome.chosen and outcome.treatment == AS_IT_IS[0]:
            outcomes[_model_name(outcome.method)].append(outcome)
    measures = []
    for disturbance in ("bias", "outliers"):
        shares = {name: _share_kept(model_outcomes, disturbance) for name, model_outcomes in outcomes.items()}
        label = f"records spoilt by {disturbance} that move the bandwidth by up to {100 * SAME:.0f} %, %"
        measures.append(Measure(label, shares, more=True, digits=0))
    return tuple(measures)


def _share_kept(outcomes: Sequence[RobustnessOutcome], disturbance: str) -> float:
    """Share of the records with a disturbance whose bandwidth is the undisturbed one's within `SAME`, percent."""
    # A bias of degree zero leaves the record as it is.
    undisturbed = [outcome for outcome in outcomes if outcome.disturbance == "bias" and outcome.degree == 0.0]
    undisturbed_hz = {outcome.joint: outcome.bandwidth_hz for outcome in undisturbed}
    kept = []
    for outcome in outcomes:
        if outcome.disturbance == disturbance and outcome.degree > 0.0 and outcome.joint in undisturbed_hz:
            # False for a model without a bandwidth, whose NaN compares with nothing.
            kept.append(abs(outcome.bandwidth_hz / undisturbed_hz[outcome.joint] - 1) <= SAME)
    return 100 * float(np.mean(kept)) if kept else float("nan")


def _exchange_fit(study: Comparison) -> tuple[Measure, ...]:
    """Fit to the record of the exchange, where the study has it."""
    if RPCM not in study.multivariable.records:
        return ()
    label = "fit {way}, mean over the joints, %"
    return _fit_measures(study, label, lambda model, way: model.fit(RPCM).mean(way), digits=2, margin=MARGIN)


def _records_followed_better(study: Comparison) -> tuple[Measure, ...]:
    """Number of held-out records on which each of two models fits better; ties and the hybrid model do not count."""
    # The exchange is a category of its own; a record of the identified sequence validates nothing.
    held_out = [name for name in study.multivariable.records if name != RPCM and not plays_identified_sequence(name)]
    measures = []
    for way in WAYS:
        values: dict[str, float] = {}
        for printed in (False, True):
            sysid, okid = study.multivariable.pair(printed=printed)
            leads = [sysid.fit(name).mean(way) - okid.fit(name).mean(way) for name in held_out]
            values[sysid.name] = float(sum(ahead(lead) for lead in leads))
            # Not the rest of the records: ties count for neither.
            values[okid.name] = float(sum(ahead(-lead) for lead in leads))
        label = (
            f"records of {len(held_out)} of other waveforms that it follows better by {MARGIN:g} points {WORDS[way]}, "
            "mean over the joints"
        )
        measures.append(Measure(label, values, more=True, digits=0))
    return tuple(measures)

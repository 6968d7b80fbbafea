"""Models of a record for its figures: with given or chosen orders, block by block where a method takes one output."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

import sysid
from scenarios.files.errors import ScenarioError
from scenarios.files.option_values import option_values
from scenarios.identification.comparison_figures import styles_of_kinds
from scenarios.identification.identification import FittedModel, fit_model, gains_with_error
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.model_comparison import JudgedModel, judged_known
from scenarios.identification.named_models import KnownModel, ModelName, known_models, parse_model_name
from scenarios.identification.order_choice import CHOSEN, choose_and_identify
from scenarios.record_figures.measured_record import MeasuredRecord
from sysid import Estimate, IOData, ResidualTest, StateSpace, SysidError, SysidWarning
from sysid.models import block_diagonal
from sysid.models.bandwidth import BandwidthClaim
from sysid.models.model_forms import as_model
from sysid.models.predict import channels_in
from sysid.plots import Style
from sysid.validation.model_error import ModelError

OF_ONE_OUTPUT = ("arx", "armax", "oe", "okid")
"""Models of a record of one output where none are named: those of the thesis' figure 49, and its chapter V's."""

OF_SEVERAL_OUTPUTS = ("armax", "okid")
"""Models of a record of several outputs where none are named: of a block for each joint, and of every path."""


@dataclass(frozen=True, eq=False)
class FigureModel:
    """A model in figures.

    Attributes:
        label: Name in legends.
        kind: `truth`, `published`, `file` or the method of an estimator.
        item: The estimate, whose bands are drawn, or a model without bands.
        style: Its look in all figures.
        orders: Its orders in words; empty for a model that is known beforehand.
        parts: The records of its estimation about its operating point; none of a model that is known beforehand.
        remarks: Doubts about it.
        error: Gains with intervals for the best linear system; None of blocks, and where not measured.
        claims: Bandwidth of each path, withheld where the record of the fit does not support it, by output and input;
            empty of a model that is known beforehand.
    """

    label: str
    kind: str
    item: Estimate | StateSpace
    style: Style
    orders: str = ""
    parts: tuple[IOData, ...] = ()
    remarks: tuple[str, ...] = ()
    error: ModelError | None = None
    claims: Mapping[tuple[int, int], BandwidthClaim] = field(default_factory=dict)

    @property
    def is_observer(self) -> bool:
        """Whether it is an estimate by OKID, which has Markov parameters of an observer."""
        return isinstance(self.item, Estimate) and self.item.method == "okid"


@dataclass(frozen=True, eq=False)
class ModelOnRecord:
    """A model of figures, judged on a record.

    Attributes:
        drawn: The model.
        judged: Its fits about its own operating point.
        checked: The record about that point.
    """

    drawn: FigureModel
    judged: JudgedModel
    checked: tuple[IOData, ...]

    @property
    def model(self) -> StateSpace:
        """The model with its channels in the sequence of the record's."""
        return self.judged.model

    def residual_test(self, lags: int, level: float) -> ResidualTest:
        """Test of its one-step residuals; raises `SysidError` where they cannot be tested."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            return sysid.resid(self.drawn.item, self.checked, lags=lags, level=level)


def model_names(words: Sequence[str], outputs: int) -> list[ModelName]:
    """Models by name: those of `hmtb compare`, and methods alone, whose orders are chosen.

    Args:
        words: The names; none stand for those of the thesis' figures.
        outputs: Number of outputs of the record.

    Raises:
        ScenarioError: A word names no model, or a method whose orders are not chosen has none.
    """
    # Polynomials of one output leave the coupling to OKID: more models of it would tell the same.
    defaults = OF_ONE_OUTPUT if outputs == 1 else OF_SEVERAL_OUTPUTS
    names = []
    # A name twice is one model.
    for word in dict.fromkeys(words or defaults):
        if word not in ESTIMATORS:
            names.append(parse_model_name(word))
        # OKID has no place in the automatic choice: its order is chosen here, by BIC.
        elif word in (*CHOSEN, "okid"):
            names.append(ModelName(word, word))
        else:
            raise ScenarioError(
                f"model {word!r} needs its orders, as {word}:{ESTIMATORS[word].usage.replace(' ', '/')}; they are "
                f"chosen for {', '.join((*CHOSEN, 'okid'))}"
            )
    return names


def figure_models(names: Sequence[ModelName], measured: MeasuredRecord) -> tuple[tuple[FigureModel, ...], list[str]]:
    """Identify models from a record, and look up those that are known.

    Returns:
        The models, and a line for each that the record does not give, with the reason.

    Raises:
        ScenarioError: A model that is known does not go with the record, or wrong orders.
    """
    models: list[FigureModel] = []
    refused: list[str] = []
    # Styles depend on all models together: two of one kind must differ.
    placeholder = Style("#000000")
    for name in names:
        if not name.is_estimated:
            record = measured.longest
            for known in known_models(name, record, measured.path):
                models.append(FigureModel(known.label, name.kind, known.model, placeholder, remarks=known.remarks))
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SysidWarning)
                models.append(_estimated(name, measured, placeholder))
        # A record too short for one structure may be long enough for another.
        except SysidError as error:
            refused.append(f"{name.text}: {error}")
    styles = styles_of_kinds([model.kind for model in models])
    return tuple(replace(model, style=style) for model, style in zip(models, styles, strict=True)), refused


def on_record(model: FigureModel, measured: MeasuredRecord) -> ModelOnRecord:
    """Judge a model on a record, about its own operating point.

    Raises:
        SysidError: The record has other channels or another sampling interval than the model.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        # As a known model: it is judged on records that it was not estimated from in the same way as on its own.
        known = KnownModel(model.label, model.item, model.remarks)
        judged = judged_known(known, model.kind, measured.parts, keep_mean=measured.keep_mean, line=False, steps=1)
    first = measured.longest
    # A record may have the channels of the model in another sequence, and the intervals are by path.
    if model.error is not None and (model.error.input_names, model.error.output_names) == (
        first.input_names,
        first.output_names,
    ):
        judged = replace(judged, error=model.error)
    if model.claims:
        judged = _with_claims(judged, model, first)
    checked = [part.subtract(y=trend) for part, trend in zip(measured.parts, judged.trends, strict=True)]
    return ModelOnRecord(model, judged, tuple(checked))


def _with_claims(judged: JudgedModel, model: FigureModel, record: IOData) -> JudgedModel:
    """A model without the bandwidths that the record of its fit does not support."""
    inputs, outputs = channels_in(as_model(model.item), record)
    hz, ci95 = judged.bandwidth_hz.copy(), judged.ci95.copy()
    for (i, output), (j, input) in product(enumerate(outputs), enumerate(inputs)):
        # blocks have no claim about paths between them, which they do not have
        if claim := model.claims.get((output, input)):
            hz[i, j], ci95[i, j] = claim.hz, (claim.low, claim.high)
    return replace(judged, bandwidth_hz=hz, ci95=ci95)


def _estimated(name: ModelName, measured: MeasuredRecord, style: Style) -> FigureModel:
    """A model identified from a record, of all outputs at once or of each by itself."""
    title, first = name.kind.upper(), measured.longest
    if first.ny == 1 or ESTIMATORS[name.kind].outputs:
        fitted = _fitted(name, measured.parts, keep_mean=measured.keep_mean)
        label = f"{title} {_orders_in_words(fitted)}"
        error = gains_with_error(fitted)
        claims = {(i, j): claim for i, row in enumerate(fitted.claims) for j, claim in enumerate(row)}
        return FigureModel(
            *(label, name.kind, fitted.estimate, style, _orders_in_words(fitted), fitted.parts),
            remarks=_doubts(claims),
            error=error,
            claims=claims,
        )
    blocks, orders, claims = [], [], {}
    # As many inputs as outputs are taken for joints, each with its own command [Morris1996, eq. 4.14].
    is_by_joint = first.nu == first.ny
    for i in range(first.ny):
        inputs = [i] if is_by_joint else None
        parts = [part.select(inputs=inputs, outputs=[i]) for part in measured.parts]
        fitted = _fitted(name, parts, keep_mean=measured.keep_mean)
        (of_output,) = fitted.claims
        # a block has the command of its own joint alone
        claims.update({(i, i if is_by_joint else j): claim for j, claim in enumerate(of_output)})
        blocks.append(fitted.estimate.model)
        orders.append(_orders_in_words(fitted))
    model = block_diagonal(blocks)
    if not is_by_joint:
        # Blocks of one output each share the inputs.
        shared = np.tile(np.eye(first.nu), (first.ny, 1))
        model = replace(model, B=model.B @ shared, D=model.D @ shared, input_names=None, output_names=None)
    # The names of the record: blocks that share an input have renumbered theirs.
    model = replace(model, input_names=first.input_names, output_names=first.output_names)
    label = f"{title}, block-diagonal" if is_by_joint else f"{title}, each output alone"
    return FigureModel(label, name.kind, model, style, "; ".join(orders), remarks=_doubts(claims), claims=claims)


def _doubts(claims: Mapping[tuple[int, int], BandwidthClaim]) -> tuple[str, ...]:
    """Reasons against the bandwidths of a model, each once."""
    return tuple(dict.fromkeys(warning for claim in claims.values() for warning in claim.warnings))


def _fitted(name: ModelName, parts: Sequence[IOData], *, keep_mean: bool) -> FittedModel:
    """Estimate a model; orders that are not given are chosen."""
    if name.orders:
        return fit_model(parts, name.kind, name.orders, keep_mean=keep_mean)
    if name.kind != "okid":
        return choose_and_identify(parts, name.kind, keep_mean=keep_mean)[0].fitted
    return fit_model(parts, "okid", _okid_orders(parts), keep_mean=keep_mean)


def _okid_orders(parts: Sequence[IOData]) -> tuple[int, int]:
    """Order of the least BIC of all that the default number of observer Markov parameters allows, and that number."""
    p = ESTIMATORS["okid"].optional["p"]
    if not isinstance(p, int):
        raise ScenarioError(f"okid: expected a number p of observer Markov parameters, given {p}")
    criteria: dict[int, float] = {}
    reason = "no order could be fitted"
    # An observer with p Markov parameters realises at most p states for each output.
    for order in range(1, p * parts[0].ny + 1):
        try:
            criterion = sysid.okid(parts, order, p=p).bic
        except SysidError as error:
            reason = str(error)
            continue
        if np.isfinite(criterion):
            criteria[order] = criterion
    if not criteria:
        raise SysidError(reason)
    return min(criteria, key=lambda order: criteria[order]), p


def _orders_in_words(fitted: FittedModel) -> str:
    """Orders in their usual sequence, apart by slashes; those of several inputs apart by commas, as they are typed."""
    return "/".join(option_values(tuple(fitted.orders.values())))

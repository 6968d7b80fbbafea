"""Every form of a model that functions on data accept, as a discrete-time state-space model."""

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, Union, cast

import numpy as np
import scipy

from sysid.models.continuous_model import ContinuousModel
from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

if TYPE_CHECKING:
    import control
    from scipy.signal import dlti, lti

OTHER_FORMS = (
    "Polynomials, a ContinuousModel, a StateSpace or TransferFunction of python-control, an lti or dlti of SciPy"
)


class Choice(Protocol):
    """A choice between models, as `auto` returns it, which stands for its estimate."""

    @property
    def estimate(self) -> Estimate:
        """The chosen model."""


AnyModel: TypeAlias = Union[
    StateSpace,
    Estimate,
    Choice,
    Polynomials,
    ContinuousModel,
    "control.StateSpace",
    "control.TransferFunction",
    "lti",
    "dlti",
]
"""A model in any form. Continuous-time ones are sampled at the interval of the data, exactly for a held input."""


def chosen_model(model: AnyModel) -> StateSpace | Estimate:
    """The estimate of a choice; other models, and what is none, unchanged."""
    # by its attribute: the classes of choices belong to rooms that build on this one
    inner = getattr(model, "estimate", None)
    return inner if isinstance(inner, Estimate) else cast("StateSpace | Estimate", model)


def as_model(model: AnyModel, data: IOData | None = None) -> StateSpace:
    """The state-space model of a model in any form.

    Args:
        model: The model. Polynomials and systems without sampling interval take that of the data; continuous-time ones
            are sampled at it, exactly for an input that is held between samples, or linear where the data say so
            (a `ContinuousModel` knows its input).
        data: Where the model will be used; None: nowhere, and the model needs a sampling interval of its own.

    Raises:
        SysidError: No model, a model without the sampling interval that it needs, or one that is not causal.
    """
    model = chosen_model(model)
    if isinstance(model, Estimate):
        return model.model
    if isinstance(model, StateSpace):
        return model
    if isinstance(model, ContinuousModel):
        return model.sampled(None if data is None else data.dt)
    if isinstance(model, Polynomials):
        return innovations_form(model, _interval(data, "Polynomials have", "innovations_form(polynomials, dt)"))
    system = _foreign_system(model)
    if system is None:
        check_no_data(model)
        raise SysidError(f"expected a StateSpace or an Estimate, got {type(model).__name__}; or {OTHER_FORMS}")
    return system.sampled(data)


def check_no_data(model: object) -> None:
    """Refuse a record where a model is expected."""
    if isinstance(model, IOData):
        raise SysidError("expected a StateSpace or an Estimate, got IOData: the model comes first, then the data")


def is_foreign(model: object) -> bool:
    """Whether a model is a system of python-control or SciPy."""
    return _python_control(model) or _scipy(model)


def _interval(data: IOData | None, subject: str, remedy: str) -> float:
    """Sampling interval of the data; refuse a model that has none without data."""
    if data is None:
        raise SysidError(f"{subject} no sampling interval: {remedy} gives one")
    return data.dt


class _System:
    """Matrices of a system of another package, and its time.

    Attributes:
        states: A, B, C, D and the names of channels; its `dt` means nothing.
        dt: Sampling interval in s; 0 in continuous time, None in discrete time without an interval.
    """

    def __init__(self, states: StateSpace, dt: float | None) -> None:
        self.states, self.dt = states, dt

    def sampled(self, data: IOData | None) -> StateSpace:
        """The model in discrete time, at the interval of the data where it has none of its own."""
        if self.dt:
            return replace(self.states, dt=self.dt)
        if self.dt is None:
            return replace(
                self.states, dt=_interval(data, "the system, of dt = True, has", "the same system with its dt in s")
            )
        dt = _interval(data, "a continuous-time system has", "c2d(system, dt)")
        hold = "foh" if data is not None and data.intersample == "foh" else "zoh"
        states = replace(self.states, dt=dt)
        return ContinuousModel(states, np.zeros(states.D.shape), hold).sampled()


def _python_control(model: object) -> bool:
    # whoever has such an object has loaded its package: nobody else waits for it
    package = sys.modules.get("control")
    return package is not None and isinstance(model, package.StateSpace | package.TransferFunction)


def _scipy(model: object) -> bool:
    package = sys.modules.get("scipy.signal")
    return package is not None and isinstance(model, package.lti | package.dlti)


def _foreign_system(model: Any) -> _System | None:
    """The system of python-control or SciPy; None where it is none."""
    if _python_control(model):
        return _System(_states_of_control(model), _interval_of_control(model))
    if _scipy(model):
        is_discrete = isinstance(model, scipy.signal.dlti)
        matrices = _proper(model.to_ss)
        # dt = True is discrete time without an interval
        interval = model.dt if is_discrete else 0.0
        dt = None if interval is True or interval is None else float(interval)
        return _System(_states(matrices.A, matrices.B, matrices.C, matrices.D), dt)
    return None


def _interval_of_control(system: Any) -> float | None:
    """Sampling interval of a python-control system, as `_System` has it."""
    if system.dt is None and not len(system.poles()):
        # a static gain has neither time
        return None
    if system.dt is None:
        raise SysidError("the system is neither continuous nor discrete in time (dt = None): give it dt")
    return None if system.dt is True else float(system.dt)


def _states_of_control(system: Any) -> StateSpace:
    """State space of a python-control system, of transfer functions path by path, and the names of its channels."""
    is_fraction = hasattr(system, "num")
    states = _states_of_fractions(system) if is_fraction else _states(system.A, system.B, system.C, system.D)
    labels = StateSpace.names_of_control(system)
    return replace(states, input_names=labels[0], output_names=labels[1])


def _states_of_fractions(system: Any) -> StateSpace:
    """State space of a matrix of transfer functions; python-control itself needs Slycot for more than one path."""
    ny, nu = system.noutputs, system.ninputs
    blocks = []
    inputs, outputs = [], []
    D = np.zeros((ny, nu))
    for i, j in np.ndindex(ny, nu):
        numerator, denominator = system.num[i][j], system.den[i][j]
        if not np.any(numerator):
            continue
        A, B, C, D_path = _proper(partial(scipy.signal.tf2ss, numerator, denominator))
        D[i, j] = D_path.item()
        # of a gain alone SciPy makes a state that nothing drives
        if len(np.trim_zeros(denominator, "f")) > 1:
            blocks.append(A)
            inputs.append(_column(B, j, nu))
            outputs.append(_column(C.T, i, ny).T)
    if not blocks:
        return _states(np.zeros((0, 0)), np.zeros((0, nu)), np.zeros((ny, 0)), D)
    return _states(scipy.linalg.block_diag(*blocks), np.vstack(inputs), np.hstack(outputs), D)


def _column(values: FloatArray, place: int, count: int) -> FloatArray:
    """A column (n, 1) at its place among columns of zeros (n, count)."""
    out = np.zeros((len(values), count))
    out[:, [place]] = values
    return out


def _states(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> StateSpace:
    return StateSpace(A, B, C, D, None, 1.0)


def _proper(convert: Callable[[], Any]) -> Any:
    """A conversion to state space; refuse systems that know the future."""
    try:
        return convert()
    except ValueError as error:
        raise SysidError(f"the system has no state space: {error}") from error

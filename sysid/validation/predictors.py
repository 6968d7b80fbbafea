"""Predictors of scored records: outputs simulated from the initialisation window, or predicted some steps ahead."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.models.predict import channels_in, predict
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning


class Predictor(Protocol):
    """Predicts the outputs of a record."""

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny).

        Args:
            record: Inputs, outputs and the window.
            steps: How far ahead: the output at t may use those up to t - steps; 0: those of the window alone.
        """
        ...


@dataclass(frozen=True, eq=False)
class ModelPredictor:
    """A linear model about an operating point.

    Attributes:
        model: The model.
        inputs: Inputs of the operating point (nu,), rad; None with `outputs`.
        outputs: Its outputs (ny,), rad. None: a constant on every output is estimated from the window, together with
            the initial state.
    """

    model: StateSpace
    inputs: FloatArray | None = None
    outputs: FloatArray | None = None

    def __post_init__(self) -> None:
        if (self.inputs is None) != (self.outputs is None):
            raise SysidError("an operating point has inputs and outputs; one of them given")

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny); the initial state is fitted by least squares to the window alone.

        Without a window the model starts at rest at its operating point.

        Raises:
            SysidError: Neither a window nor an operating point: the level of the outputs is unknown.
            SysidError: The channels are not those of the model.
        """
        ahead = steps or None
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # An unstable predictor shows in its score.
            warnings.simplefilter("ignore", SysidWarning)
            if self.inputs is not None and self.outputs is not None:
                inputs, outputs = channels_in(self.model, record)
                level = self.outputs[outputs]
                about = record.subtract(u=self.inputs[inputs], y=level)
                start = None if record.window else np.zeros(self.model.order)
                return predict(self.model, about, steps=ahead, x0=start) + level
            if not record.window:
                raise SysidError(
                    f"{record.name or 'the record'} has no initialisation window, so the level of its outputs is "
                    "unknown; expected a model with its operating point"
                )
            # the mean of the inputs in the window takes the place of their operating point
            about = record.subtract(u=record.u[: record.window].mean(axis=0))
            return predict(_with_constant(self.model), about, steps=ahead)


@dataclass(frozen=True, eq=False)
class StackedPredictor:
    """A predictor for every output.

    Attributes:
        rows: One per output, each of all inputs.
    """

    rows: tuple[Predictor, ...]

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny)."""
        columns = []
        for i, row in enumerate(self.rows):
            columns.append(row.predicted(record.select(outputs=[i]), steps))
        return np.hstack(columns)


@dataclass(frozen=True, eq=False)
class Hold:
    """The last output that is known.

    Attributes:
        level: Outputs before any is known (ny,), rad.
    """

    level: FloatArray

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny)."""
        # without steps nothing is known but the window
        last = np.arange(len(record)) - steps if steps else np.full(len(record), record.window - 1)
        return np.where((last >= 0)[:, None], record.y[np.maximum(last, 0)], self.level)

    @classmethod
    def fitted(cls, parts: Sequence[IOData]) -> "Hold":
        """Take the mean of all records for the level."""
        return cls(np.concatenate([record.y for record in parts]).mean(axis=0))


@dataclass(frozen=True, eq=False)
class StaticGain:
    """Outputs proportional to the inputs of the same sample.

    Attributes:
        gain: (ny, nu).
        level: (ny,), rad.
    """

    gain: FloatArray
    level: FloatArray

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny)."""
        return np.asarray(record.u @ self.gain.T + self.level)

    @classmethod
    def fitted(cls, parts: Sequence[IOData]) -> "StaticGain":
        """Fit gain and level to records by least squares."""
        u = np.concatenate([record.u for record in parts])
        y = np.concatenate([record.y for record in parts])
        solution, *_ = np.linalg.lstsq(np.column_stack([u, np.ones(len(u))]), y, rcond=None)
        return cls(solution[:-1].T, solution[-1])


def as_predictor(model: Predictor | StateSpace | Estimate) -> Predictor:
    """Return a predictor of a model; a bare model finds its operating point in each window."""
    if isinstance(model, Estimate):
        return ModelPredictor(model.model)
    if isinstance(model, StateSpace):
        return ModelPredictor(model)
    return model


def _with_constant(model: StateSpace) -> StateSpace:
    """The model with one more state per output, a constant that adds to it."""
    ny = model.ny
    A = scipy.linalg.block_diag(model.A, np.eye(ny))
    B = np.vstack([model.B, np.zeros((ny, model.nu))])
    C = np.hstack([model.C, np.eye(ny)])
    # innovations do not move the constant: the window alone determines it
    K = np.vstack([model.gain, np.zeros((ny, ny))])
    return replace(model, A=A, B=B, C=C, K=K)

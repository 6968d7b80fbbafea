"""What was measured of one trial: all that the figures need, and nothing that only its process knows."""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.estimators.outcome import KINDS
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import ASKS, Trial
from sysid.records.arrays import ComplexArray, FloatArray, Locked

ARRAYS = ("response", "response_covariance", "bandwidth_hz", "bandwidth_ci95", "nonparametric")


@dataclass(frozen=True, eq=False)
class Measured(Locked):
    """A trial's outcome against the truth.

    Attributes:
        trial: The trial.
        kind: Kind of its outcome; see `scenarios.estimators.outcome.KINDS`.
        why: Its reason, where it is no model.
        seconds: Processor time, s; NaN where not known.
        ruler_seconds: Processor time of a fixed least-squares problem on the same record in the same run, s: times of
            estimators are told as multiples of it.
        peak_bytes: The most memory, bytes; 0 where not known.
        order: Of the model from input to output, states that cancel left out; -1 where there is no model.
        response: From input to output at the problem's frequencies (nf, ny, nu); None where there is no stable model.
        response_covariance: Claimed (nf, ny, nu, 2, 2), or None.
        normalised_error: error' covariance^-1 error of the parameters, by the claimed covariance; NaN where none is
            claimed or the parameters are not those of the truth's structure.
        parameters: Number of parameters that it has.
        covered: How many true parameters lie within their claimed 95 % intervals; -1 where not claimed.
        bandwidth_hz: (ny, nu); NaN where there is none; None where there is no stable model.
        bandwidth_ci95: (2, ny, nu), or None.
        whiteness_p: p-value of the residuals' whiteness test, the least of all outputs; NaN where not tested.
        independence_p: Of their independence of past inputs, the least of all pairs; NaN where not tested.
        nonparametric: Response that the record shows without a model, at the same frequencies (nf, ny, nu); None where
            the problem's records are not periodic.
    """

    trial: Trial
    kind: str
    why: str = ""
    seconds: float = float("nan")
    ruler_seconds: float = float("nan")
    peak_bytes: int = 0
    order: int = -1
    response: ComplexArray | None = None
    response_covariance: FloatArray | None = None
    normalised_error: float = float("nan")
    parameters: int = 0
    covered: int = -1
    bandwidth_hz: FloatArray | None = None
    bandwidth_ci95: FloatArray | None = None
    whiteness_p: float = float("nan")
    independence_p: float = float("nan")
    nonparametric: ComplexArray | None = None

    def to_json(self) -> str:
        """One line."""
        return json.dumps({name: _told(value) for name, value in vars(self).items()}, allow_nan=True)

    @classmethod
    def from_json(cls, line: str) -> "Measured":
        """Read a line of `to_json`.

        Raises:
            ScenarioError: It is none.
        """
        try:
            table = json.loads(line)
            trial = Trial(**table.pop("trial"))
            read = cls(trial=trial, **{name: _read(value) for name, value in table.items()})
            _check(read)
            return read
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise ScenarioError(f"{line[:80]!r} is no measured trial: {error}") from error


def _check(read: Measured) -> None:
    """Of what a damaged file may hold: figures count on these.

    Raises:
        ValueError: It is of another type.
    """
    trial = read.trial
    if not isinstance(trial.problem, str) or type(trial.draw) is not int or trial.ask not in ASKS:
        raise ValueError(f"no trial: {trial}")
    if read.kind not in KINDS or not isinstance(read.why, str):
        raise ValueError(f"kind {read.kind!r}")
    for name, value in vars(read).items():
        if name in ARRAYS and not (value is None or isinstance(value, np.ndarray)):
            raise ValueError(f"{name} of type {type(value).__name__}")
        if name not in (*ARRAYS, "trial", "kind", "why") and type(value) not in (int, float):
            raise ValueError(f"{name} of type {type(value).__name__}")


def _told(value: Any) -> Any:
    if isinstance(value, Trial):
        return vars(value)
    if isinstance(value, np.ndarray):
        if np.iscomplexobj(value):
            return {"complex": np.stack((value.real, value.imag), axis=-1).tolist()}
        return {"real": value.tolist()}
    return value


def _read(value: Any) -> Any:
    if isinstance(value, dict):
        if "complex" in value:
            pairs = np.array(value["complex"], dtype=float)
            return pairs[..., 0] + 1j * pairs[..., 1]
        return np.array(value["real"], dtype=float)
    return value

"""A model of a joint that a student hands in: matrices, or poles, zeros and gain, read from numbers alone."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.files.errors import ScenarioError
from scenarios.files.mat_numbers import read_mat_numbers
from scenarios.files.netcdf import read_netcdf
from sysid import FrequencyResponse, StateSpace, SysidError
from sysid.models.bandwidth import HALF_POWER, gain_crossing

ENDINGS = (".json", ".mat", ".nc")
"""Endings of files of models."""

MOST_BYTES = 2**24
"""No file of a model is larger."""

MOST_ORDER = 200
"""No model of a joint has a higher order."""

LARGEST = 1e9
"""No number of a model, and no gain of it at any frequency, is larger."""

PAIRED = 1e-6
"""So far, relative to it, a complex root may be from the conjugate of another one."""

MATRICES, ROOTS = ("A", "B", "C", "D"), ("poles", "zeros", "gain")

FORMAT = """JSON, .mat (version 7 or older) or NetCDF4 with dt = 0.02 and either the matrices A (n, n), B (n, 1),
C (1, n), D (1, 1) of x(t+1) = A x + B u, y = C x + D u, or poles, zeros and gain of the transfer function in z;
complex numbers as pairs of real and imaginary part, in .mat also as such"""
"""What a model looks like."""


@dataclass(frozen=True, eq=False)
class SubmittedModel:
    """A discrete-time model from commanded to measured angle.

    Attributes:
        poles: In the z plane.
        response: Frequency response at frequencies in Hz (m,) -> (m,).
    """

    poles: np.ndarray
    response: Callable[[np.ndarray], np.ndarray]

    @property
    def dc_gain(self) -> float:
        """Gain at 0 Hz."""
        return float(self.response(np.zeros(1))[0].real)

    @property
    def bandwidth_hz(self) -> float:
        """First frequency at which the gain is 3.01 dB below that at 0 Hz, Hz; NaN if it never is."""
        f = frequencies()
        found = FrequencyResponse(f, self.response(f)[:, None, None], SAMPLE_TIME, "model")
        return gain_crossing(found, HALF_POWER * abs(self.dc_gain))

    @property
    def stable(self) -> bool:
        """Whether all poles lie within the unit circle."""
        return bool((np.abs(self.poles) < 1.0).all())


def frequencies() -> np.ndarray:
    """Frequencies at which a bandwidth is looked for, Hz."""
    return np.geomspace(0.005, 0.5 / SAMPLE_TIME, 4000)


def read_model(path: Path) -> SubmittedModel:
    """Read a model; see `FORMAT`.

    Args:
        path: The file.

    Raises:
        ScenarioError: It is damaged, or holds something else.
    """
    if path.stat().st_size > MOST_BYTES:
        raise ScenarioError(f"{path} has {path.stat().st_size} bytes, expected a model of at most {MOST_BYTES}")
    reader = {".json": _read_json, ".mat": _read_mat, ".nc": _read_netcdf}[path.suffix]
    values = reader(path)
    if "dt" not in values or values["dt"].size != 1:
        raise ScenarioError(f"{path} does not say its sampling time: expected dt = {SAMPLE_TIME:g}, s")
    dt = float(values["dt"].ravel()[0].real)
    if not abs(dt - SAMPLE_TIME) <= 1e-9:
        raise ScenarioError(f"{path}: dt = {dt:g} given, expected a discrete-time model with {SAMPLE_TIME:g} s")
    kinds = [kind for kind in (MATRICES, ROOTS) if set(kind) <= values.keys()]
    if len(kinds) != 1:
        given = ", ".join(sorted(values)) or "nothing"
        raise ScenarioError(f"{path}: {given} given, expected either A, B, C and D or poles, zeros and gain, and dt")
    for name in kinds[0]:
        if not np.isfinite(values[name]).all():
            raise ScenarioError(f"{path}: {name} has numbers that are not finite")
        if (np.abs(values[name]) > LARGEST).any():
            raise ScenarioError(f"{path}: {name} has numbers above {LARGEST:g}, which no model of a joint has")
    model = _of_matrices(path, values) if kinds[0] == MATRICES else _of_roots(path, values)
    _check_gain(path, model)
    return model


def _check_gain(path: Path, model: SubmittedModel) -> None:
    """Refuse a model whose gain is not a number wherever it is compared: an integrator has none at 0 Hz."""
    for f in (np.zeros(1), frequencies()):
        try:
            with np.errstate(all="ignore"):
                gain = np.abs(model.response(f))
        except (np.linalg.LinAlgError, SysidError):
            gain = np.array([np.inf])
        if not (gain <= LARGEST).all():
            raise ScenarioError(
                f"{path}: the model's gain {'at 0 Hz' if len(f) == 1 else 'at some frequency'} is infinite, or above "
                f"{LARGEST:g}: it has a pole at 1 or elsewhere on the unit circle; expected finite gains"
            )


def of_state_space(model: StateSpace) -> SubmittedModel:
    """A model of one input and one output in state space."""
    return SubmittedModel(np.linalg.eigvals(model.A), lambda f: model.frequency_response(f)[:, 0, 0])


def _of_matrices(path: Path, values: Mapping[str, np.ndarray]) -> SubmittedModel:
    n = values["A"].shape[0] if values["A"].ndim == 2 else -1
    wanted = {"A": (n, n), "B": (n, 1), "C": (1, n), "D": (1, 1)}
    for name, shape in wanted.items():
        if values[name].shape != shape or not 1 <= n <= MOST_ORDER or values[name].dtype.kind == "c":
            raise ScenarioError(
                f"{path}: {name} of shape {values[name].shape} given, expected real matrices A (n, n), B (n, 1), "
                f"C (1, n), D (1, 1), n from 1 to {MOST_ORDER}"
            )
    a, b, c, d = (values[name].astype(float) for name in MATRICES)
    return of_state_space(StateSpace(a, b, c, d, K=None, dt=SAMPLE_TIME))


def _of_roots(path: Path, values: Mapping[str, np.ndarray]) -> SubmittedModel:
    poles, zeros = (values[name].astype(complex).ravel() for name in ("poles", "zeros"))
    if not 1 <= len(poles) <= MOST_ORDER or len(zeros) > len(poles):
        raise ScenarioError(
            f"{path}: {len(poles)} poles and {len(zeros)} zeros given, expected 1 to {MOST_ORDER} poles and no more "
            "zeros"
        )
    for name, roots in (("poles", poles), ("zeros", zeros)):
        if not _in_pairs(roots):
            raise ScenarioError(f"{path}: complex {name} without their conjugates given, expected pairs")
    if values["gain"].size != 1 or values["gain"].dtype.kind == "c":
        raise ScenarioError(f"{path}: gain of shape {values['gain'].shape} given, expected one real number")
    gain = float(values["gain"].ravel()[0])

    def response(f: np.ndarray) -> np.ndarray:
        z = np.exp(2j * np.pi * SAMPLE_TIME * np.asarray(f))[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(gain * np.prod(z - zeros, axis=1) / np.prod(z - poles, axis=1))

    return SubmittedModel(poles, response)


def _in_pairs(roots: np.ndarray) -> bool:
    """Whether roots are those of a polynomial with real coefficients."""
    distance = np.abs(roots[:, None] - roots.conj()[None, :])
    rows, columns = linear_sum_assignment(distance)
    return bool((distance[rows, columns] <= PAIRED * np.maximum(1.0, np.abs(roots[rows]))).all())


def _read_json(path: Path) -> dict[str, np.ndarray]:
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ScenarioError(f"cannot read {path}: {error}") from error
    if not isinstance(table, dict):
        raise ScenarioError(f"{path}: expected a JSON object, {FORMAT}")
    unknown = sorted(table.keys() - {*MATRICES, *ROOTS, "dt"})
    if unknown:
        raise ScenarioError(f"{path}: unknown key {unknown[0]!r}, expected dt, A, B, C, D or dt, poles, zeros, gain")
    return {name: _numbers(path, name, value) for name, value in table.items()}


def _numbers(path: Path, name: str, value: object) -> np.ndarray:
    if name in ("poles", "zeros"):
        if not isinstance(value, list):
            raise ScenarioError(f"{path}: {name} = {str(value)[:50]!r} given, expected a list of numbers or pairs")
        return np.array([_complex(path, name, entry) for entry in value], dtype=complex)
    try:
        found = np.array(value)
        if found.dtype.kind not in "if":
            raise ValueError("no numbers")
        return found.astype(float)
    except (ValueError, OverflowError) as error:
        raise ScenarioError(f"{path}: {name} = {str(value)[:50]!r} given, expected numbers in rows") from error


def _complex(path: Path, name: str, entry: object) -> complex:
    parts = entry if isinstance(entry, list) else [entry, 0.0]
    numbers = [x for x in parts if isinstance(x, int | float) and not isinstance(x, bool)]
    if len(parts) != 2 or len(numbers) != 2:
        raise ScenarioError(f"{path}: {name} holds {str(entry)[:50]!r}, expected a number or [real, imaginary]")
    try:
        return complex(*numbers)
    except OverflowError as error:
        raise ScenarioError(f"{path}: {name} has numbers above {LARGEST:g}, which no model of a joint has") from error


def _read_mat(path: Path) -> dict[str, np.ndarray]:
    found = read_mat_numbers(path, (*MATRICES, *ROOTS, "dt"))
    return {name: _real_or_complex(path, name, values) for name, values in found.items()}


def _read_netcdf(path: Path) -> dict[str, np.ndarray]:
    contents = read_netcdf(path)
    values = {name: variable.values for name, variable in contents.variables.items()}
    if "dt" in contents.attributes:
        values["dt"] = np.asarray(contents.attributes["dt"])
    for name in ("poles", "zeros"):
        if name in values and values[name].shape[1:] == (2,) and values[name].dtype.kind == "f":
            values[name] = values[name][:, 0] + 1j * values[name][:, 1]
    known = (*MATRICES, *ROOTS, "dt")
    return {name: _real_or_complex(path, name, values[name]) for name in known if name in values}


def _real_or_complex(path: Path, name: str, values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "iufc":
        raise ScenarioError(f"{path}: {name} of type {values.dtype} given, expected numbers")
    return values

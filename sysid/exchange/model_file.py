"""The model file: a model or estimate as JSON, every bit of it, described in docs/model-file.md."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from sysid.exchange.files import operating_point, software, write_whole
from sysid.exchange.json_text import decoded, encoded, parsed, table, text_of, texts
from sysid.exchange.parameters import Coefficients, LinearEntries, Place, derivatives, entries, places_of
from sysid.models.estimate import DataSummary, Estimate
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace
from sysid.records.arguments import sampling_interval, shown, whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.errors import SysidError

FORMAT, VERSION = "sysid-model", 1
ENDING = ".json"
LABELS = ("input_names", "output_names", "input_units", "output_units")
HEAD = ("format", "version", "kind", "software")
ESTIMATE = (
    "state_space",
    "polynomials",
    "parameters",
    "noise_variance",
    "method",
    "orders",
    "data",
    "fit",
    "diagnostics",
    "residuals",
)
SIDES = ("input", "output")
MATRICES = ("A", "B", "C", "D", "K")


def write_model(model: Estimate | StateSpace | Polynomials, path: str | Path, *, command: str | None = None) -> Path:
    """Write a model file; `read_model` returns an equal model.

    Every number keeps all its bits. Equal models make equal files: nothing in them is a time. Diagnostics that JSON
    cannot hold are left out.

    Args:
        model: An estimate, a state-space model or polynomials.
        path: Where to write; the name ends with .json.
        command: How the model was made, for the reader of the file.

    Returns:
        The file.

    Raises:
        SysidError: Something else, another ending, a folder of that name.
    """
    file = Path(path)
    if file.suffix != ENDING:
        raise SysidError(f"cannot write {file.name}: expected a name that ends with {ENDING}")
    head: dict[str, Any] = {"format": FORMAT, "version": VERSION, "kind": "", "software": software()}
    if command is not None:
        head["command"] = str(command)
    if isinstance(model, Estimate):
        content = head | {"kind": "estimate"} | _estimate(model)
    elif isinstance(model, StateSpace):
        content = head | {"kind": "state_space", "state_space": _state_space(model)}
    elif isinstance(model, Polynomials):
        content = head | {"kind": "polynomials", "polynomials": _polynomials(model)}
    else:
        raise SysidError(f"expected an Estimate, a StateSpace or Polynomials, got {type(model).__name__}")
    write_whole({file: (text_of(content) + "\n").encode("ascii")})
    return file


def read_model(path: str | Path) -> Estimate | StateSpace | Polynomials:
    """Read a model file.

    Args:
        path: The file, as `write_model` writes it.

    Returns:
        What was written: an estimate with covariance, residuals and diagnostics, a state-space model or polynomials.
        Of estimates whose parameters are no coefficients of polynomials, `realise` is linear in the parameters.

    Raises:
        SysidError: No file, no JSON, another format or version, keys that are missing or unknown, numbers that are not
            finite, shapes that do not fit.
    """
    file = Path(path)
    content = parsed(file)
    try:
        return _model(content)
    except SysidError as error:
        raise SysidError(f"{file.name}: {error}") from error


def _state_space(m: StateSpace) -> dict[str, Any]:
    covariance = m.innovation_covariance
    return {
        "dt": m.dt,
        **{name: getattr(m, name).tolist() for name in MATRICES[:4]},
        "K": m.gain.tolist(),
        "innovation_covariance": None if covariance is None else covariance.tolist(),
        **{name: list(getattr(m, name) or ()) for name in LABELS},
    }


def _polynomials(p: Polynomials) -> dict[str, Any]:
    return {name: getattr(p, name).tolist() for name in "ABCDF"}


def _estimate(e: Estimate) -> dict[str, Any]:
    places = places_of(e)
    parameters = {
        "names": list(e.parameter_names),
        "values": e.parameters.tolist(),
        "covariance": _with_nulls(e.covariance),
    }
    if places is not None:
        parameters["places"] = [list(place) for place in places]
    else:
        slopes = derivatives(e)
        parameters["derivatives"] = None if slopes is None else slopes.tolist()
    diagnostics = {}
    for name, value in e.diagnostics.items():
        with suppress(TypeError):
            diagnostics[name] = encoded(value)
    point = dict(zip(SIDES, (level.tolist() for level in operating_point(e)), strict=True))
    known = diagnostics.pop("operating_point", None) is not None
    return {
        **({"operating_point": point} if known else {}),
        "method": e.method,
        "orders": {name: encoded(value) for name, value in e.orders.items()},
        "data": {field.name: encoded(getattr(e.data, field.name)) for field in fields(DataSummary)},
        "state_space": _state_space(e.model),
        "polynomials": None if e.polynomials is None else _polynomials(e.polynomials),
        "parameters": parameters,
        "noise_variance": e.noise_variance.tolist(),
        "fit": {name: encoded(getattr(e, name)) for name in ("loss", "fpe", "aic", "bic")},
        "diagnostics": diagnostics,
        "residuals": _with_nulls(e.residuals),
    }


def _with_nulls(array: FloatArray) -> list[Any] | None:
    """Rows with null for NaN; None where no entry is known."""
    if array.size and np.isnan(array).all():
        return None
    return [[None if np.isnan(value) else value for value in row] for row in array.tolist()]


def _model(content: Any) -> Estimate | StateSpace | Polynomials:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise SysidError(f'no model file: expected a table with "format": "{FORMAT}"')
    version = content.get("version")
    if version != VERSION or isinstance(version, bool):
        raise SysidError(f"version {shown(version)} given, expected {VERSION}: another version of the package wrote it")
    kind = content.get("kind")
    if kind == "estimate":
        top = table("the file", content, (*HEAD, *ESTIMATE), ("command", "operating_point"))
        return _read_estimate(top)
    if kind not in ("state_space", "polynomials"):
        raise SysidError(f"kind {shown(kind)} given, expected estimate, state_space or polynomials")
    top = table("the file", content, (*HEAD, kind), ("command",))
    return _read_state_space(top[kind]) if kind == "state_space" else _read_polynomials(top[kind])


def _read_state_space(value: Any) -> StateSpace:
    t = table("state_space", value, ("dt", *MATRICES, "innovation_covariance", *LABELS))
    t |= {name: real_array(f"state_space.{name}", t[name]) for name in MATRICES}
    return StateSpace(**t | {name: texts(f"state_space.{name}", t[name]) for name in LABELS})


def _read_polynomials(value: Any) -> Polynomials:
    t = table("polynomials", value, tuple("ABCDF"))
    return Polynomials(**{name: real_array(f"polynomials.{name}", t[name]) for name in "ABCDF"})


def _read_estimate(top: Mapping[str, Any]) -> Estimate:
    model = _read_state_space(top["state_space"])
    polynomials = None if top["polynomials"] is None else _read_polynomials(top["polynomials"])
    data = _read_data(top["data"], model)
    t = table("parameters", top["parameters"], ("names", "values", "covariance"), ("places", "derivatives"))
    names = texts("parameters.names", t["names"])
    values = _array("parameters.values", t["values"], (len(names),))
    covariance = _known("parameters.covariance", t["covariance"], (len(names), len(names)))
    realise: Coefficients | LinearEntries
    if "places" in t and "derivatives" not in t and polynomials is not None:
        realise = Coefficients(polynomials, _read_places(t["places"], polynomials), data, model.innovation_covariance)
        if not len(realise.places) == len(set(realise.places)) == len(names) or not np.array_equal(
            entries(realise(values)), entries(model)
        ):
            raise SysidError("parameters.places: the polynomials with these parameters are not the model")
    elif "derivatives" in t and "places" not in t:
        shape = (len(names), len(entries(model)))
        slopes = t["derivatives"]
        slopes = None if slopes is None else _array("parameters.derivatives", slopes, shape)
        realise = LinearEntries(model, values, slopes)
    else:
        raise SysidError("parameters: expected either places, beside polynomials, or derivatives")
    method = top["method"]
    if not isinstance(method, str):
        raise SysidError(f"method: expected a text, got {shown(method)}")
    tables = {}
    for key in ("orders", "diagnostics"):
        if not isinstance(top[key], dict):
            raise SysidError(f"{key}: expected a table, got {shown(top[key])}")
        tables[key] = {name: decoded(f"{key}.{name}", entry) for name, entry in top[key].items()}
    if "operating_point" in top:
        point = table("operating_point", top["operating_point"], SIDES)
        tables["diagnostics"]["operating_point"] = tuple(
            _array(f"operating_point.{side}", point[side], (count,))
            for side, count in zip(SIDES, (model.nu, model.ny), strict=True)
        )
    return Estimate(
        model=model,
        polynomials=polynomials,
        parameters=values,
        parameter_names=names,
        covariance=covariance,
        noise_variance=_array("noise_variance", top["noise_variance"], (model.ny, model.ny)),
        residuals=_known("residuals", top["residuals"], (None, model.ny)),
        method=method,
        data=data,
        realise=realise,
        **tables,
    )


def _read_data(value: Any, model: StateSpace) -> DataSummary:
    required = [field.name for field in fields(DataSummary) if field.default is MISSING]
    optional = [field.name for field in fields(DataSummary) if field.default is not MISSING]
    t = dict(table("data", value, required, optional))
    for name in (*LABELS, "names"):
        t[name] = texts(f"data.{name}", t[name])
    for name, count in zip(LABELS, 2 * (model.nu, model.ny), strict=True):
        if len(t[name]) != count:
            raise SysidError(f"data.{name}: expected {count}, one per channel of the model, got {len(t[name])}")
    if not isinstance(t["samples"], list) or len(t["samples"]) != len(t["names"]):
        raise SysidError(f"data.samples: expected one number per experiment, {len(t['names'])}")
    t["samples"] = tuple(whole_number("data.samples", count, 0) for count in t["samples"])
    t["dt"] = sampling_interval(t["dt"])
    if t.get("intersample", "zoh") not in ("zoh", "foh", "bl"):
        raise SysidError(f"data.intersample: expected zoh, foh or bl, got {shown(t['intersample'])}")
    return DataSummary(**{name: decoded(f"data.{name}", entry) for name, entry in t.items()})


def _read_places(value: Any, polynomials: Polynomials) -> tuple[Place, ...]:
    places = []
    for entry in value if isinstance(value, list) else ():
        match entry:
            case [("A" | "B" | "C" | "D" | "F") as name, row, power]:
                rows, powers = np.atleast_2d(getattr(polynomials, name)).shape
                least = 0 if name == "B" else 1
                place = whole_number("row", row, 0, rows - 1), whole_number("power", power, least, powers - 1)
                places.append((str(name), *place))
            case _:
                raise SysidError(f"parameters.places: expected [polynomial, row, power], got {shown(entry)}")
    return tuple(places)


def _array(where: str, value: Any, shape: tuple[int | None, ...]) -> FloatArray:
    """Check a real array; None stands for any length."""
    array = real_array(where, value)
    if not array.size and 0 in (expected := tuple(length or 0 for length in shape)):
        return array.reshape(expected)
    if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        raise SysidError(f"{where}: expected shape {shape}, got {array.shape}")
    return array


def _known(where: str, value: Any, shape: tuple[int | None, ...]) -> FloatArray:
    """As `_array`, where null stands for NaN: single entries, or all of them."""
    if value is None and None not in shape:
        return np.full([length or 0 for length in shape], np.nan)
    if not isinstance(value, list) or not all(isinstance(row, list) for row in value):
        raise SysidError(f"{where}: expected rows of numbers, got {shown(value)}")
    holes = [[entry is None for entry in row] for row in value]
    filled = [[0.0 if entry is None else entry for entry in row] for row in value]
    array = _array(where, filled, shape).copy()
    array[np.asarray(holes, dtype=bool).reshape(array.shape)] = np.nan
    return array

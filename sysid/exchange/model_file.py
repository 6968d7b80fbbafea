"""The model file: a model or estimate as JSON, every bit of it, described in docs/model-file.md."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from sysid.continuous.structures import PathStructure, ProcessPath, RationalPath, RealisePaths
from sysid.exchange.files import software, write_whole
from sysid.exchange.json_text import checked_keys, decoded, decoded_fields, encoded, parsed, tagged, text_of
from sysid.exchange.parameters import LinearEntries, entries, portable
from sysid.models.continuous import Resampled, Unsampled
from sysid.models.continuous_estimate import ContinuousEstimate, continuous_estimate
from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials
from sysid.models.predict import Choice, chosen_model
from sysid.models.state_space import StateSpace, is_covariance
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray, real_array
from sysid.records.errors import SysidError

FORMAT, VERSION = "sysid-model", 1
ENDING = ".json"
KINDS = {"estimate": Estimate, "state_space": StateSpace, "polynomials": Polynomials}
LARGEST = 1e150  # largest entry of a covariance: its squares are finite
HEAD = ("format", "version", "software")


def write_model(
    model: Estimate | StateSpace | Polynomials | Choice, path: str | Path, *, command: str | None = None
) -> Path:
    """Write a model file; `read_model` returns an equal model.

    Every number keeps all its bits. Equal models make equal files: nothing in them is a time. Diagnostics that JSON
    cannot hold are left out.

    Args:
        model: An estimate, a choice of `auto`, a state-space model or polynomials.
        path: Where to write; the name ends with .json.
        command: How the model was made, for the reader of the file.

    Returns:
        The file.

    Raises:
        SysidError: Something else, an estimate of `fit_response_ss` in continuous time, another ending, a folder of
            that name.
    """
    file = Path(path)
    if file.suffix != ENDING:
        raise SysidError(f"cannot write {file.name}: expected a name that ends with {ENDING}")
    model = model if isinstance(model, Polynomials) else chosen_model(model)
    kind = next((name for name, record in KINDS.items() if isinstance(model, record)), None)
    if kind is None:
        raise SysidError(f"expected an Estimate, a StateSpace or Polynomials, got {type(model).__name__}")
    content: dict[str, Any] = dict(zip(HEAD, (FORMAT, VERSION, software()), strict=True))
    if command is not None:
        content["command"] = str(command)
    if isinstance(model, Estimate):
        content["fit"] = {name: tagged(getattr(model, name)) for name in ("loss", "fpe", "aic", "bic")}
        content[kind] = _estimate(model)
    else:
        content[kind] = encoded(model)
    write_whole(file, (text_of(content) + "\n").encode("ascii"))
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
    try:
        return _model(parsed(file))
    except SysidError as error:
        raise SysidError(f"{file.name}: {error}") from error


def _model(content: Any) -> Estimate | StateSpace | Polynomials:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise SysidError(f'no model file: expected a table with "format": "{FORMAT}"')
    version = content.get("version")
    if version != VERSION or isinstance(version, bool):
        raise SysidError(f"version {shown(version)} given, expected {VERSION}: another version of the package wrote it")
    kinds = [kind for kind in KINDS if kind in content]
    if len(kinds) != 1:
        raise SysidError(f"expected one of the keys {', '.join(KINDS)}, got {', '.join(map(shown, content))}")
    (kind,) = kinds
    checked_keys("the file", content, (*HEAD, kind), ("command", "fit"))
    model: Estimate | StateSpace | Polynomials
    model = _read_estimate(content[kind]) if kind == "estimate" else decoded(kind, content[kind], KINDS[kind])
    return model


def _estimate(e: Estimate) -> dict[str, Any]:
    table = {field.name: encoded(getattr(e, field.name)) for field in fields(Estimate) if field.name != "realise"}
    if isinstance(e, ContinuousEstimate):
        continuous = e.realise_continuous
        if isinstance(continuous, RealisePaths):
            return table | {"paths": encoded(continuous.structures)}
        if not isinstance(continuous, Unsampled):
            raise SysidError(f"{e.method} in continuous time has no form in a model file: write c2d(estimate, dt)")
        table["unsampled"] = {"intersample": continuous.intersample, "noise": continuous.noise}
    function = portable(e)
    if isinstance(function, Realise):
        return table | {"layout": encoded(function.orders)}
    return table | {"derivatives": encoded(function.derivatives)}


def _read_estimate(value: Any) -> Estimate:
    known = decoded_fields("estimate", value, Estimate, realise=("layout", "derivatives", "paths", "unsampled"))
    model, data, theta = known["model"], known["data"], real_array("parameters", known["parameters"])
    p, ny = len(theta), model.ny
    if len(data.samples) != len(data.names) or min(data.samples, default=-1) < 0:
        raise SysidError(f"data: expected a number of samples for each of the names, got {shown(data.samples)}")
    samples = sum(data.samples)
    for name, shape in (("covariance", (p, p)), ("noise_variance", (ny, ny)), ("residuals", (samples, ny))):
        known[name] = _shaped(name, known[name], shape)
        largest = np.abs(known[name]).max(initial=0.0)  # NaN where the covariance is not known
        if name != "residuals" and not (np.isnan(largest) or (largest <= LARGEST and is_covariance(known[name]))):
            raise SysidError(f"{name}: expected a symmetric matrix without negative eigenvalues, up to {LARGEST:g}")
    if data.dt != model.dt and "derivatives" not in value:
        raise SysidError(f"data.dt: expected {model.dt:g} s as the model, got {data.dt:g}")
    if data.intersample not in ("zoh", "foh", "bl"):
        raise SysidError(f"data.intersample: expected zoh, foh or bl, got {shown(data.intersample)}")
    offsets = {"input_offset": (data.input_offset, model.nu), "output_offset": (data.output_offset, model.ny)}
    offsets["output_deviation"] = (data.output_deviation or None, model.ny)
    sides = {name: (labels, len(getattr(model, name))) for name, labels in data.labels.items()} | offsets
    for name, (values, count) in sides.items():
        if values is not None and len(values) != count:
            raise SysidError(f"data.{name}: expected {count}, one per channel of the model, got {len(values)}")
    forms = [key for key in ("layout", "derivatives", "paths") if key in value]
    realise: Realise | LinearEntries
    if forms == ["paths"] and "unsampled" not in value:
        structures = _structures(value["paths"], known["method"], (ny, model.nu), len(theta))
        continuous = RealisePaths(structures, data, data.intersample, model.innovation_covariance)
        sampled = Resampled(continuous)
        expected, got = entries(model), entries(sampled(theta))
        # matrix exponentials differ by rounding from machine to machine
        if expected.shape != got.shape or not np.allclose(got, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()):
            raise SysidError("paths: the transfer functions with these parameters are not the model")
        return ContinuousEstimate(**known, realise=sampled, realise_continuous=continuous)
    if forms == ["layout"]:
        orders = _layout(value["layout"], known["polynomials"], known["parameter_names"])
        variance = None if model.innovation_covariance is None else float(known["noise_variance"][0, 0])
        realise = Realise(orders, data, variance)
        if not np.array_equal(entries(realise(theta)), entries(model)):
            raise SysidError("layout: the polynomials with these parameters are not the model")
    elif forms == ["derivatives"]:
        moves = decoded("derivatives", value["derivatives"], FloatArray | None)
        shape = (p, len(entries(model)))
        realise = LinearEntries(model, theta, None if moves is None else _shaped("derivatives", moves, shape))
    else:
        raise SysidError("expected one of layout, of an estimate of polynomials, derivatives, and paths")
    estimate = Estimate(**known, realise=realise)
    if "unsampled" not in value:
        return estimate
    how = value["unsampled"]
    checked_keys("unsampled", how, ("intersample", "noise"))
    if how["intersample"] not in ("zoh", "foh") or not isinstance(how["noise"], bool):
        raise SysidError(f"unsampled: expected intersample zoh or foh and noise true or false, got {shown(how)}")
    return continuous_estimate(estimate, Unsampled(realise, **how))


def _structures(
    value: Any, method: str, shape: tuple[int, int], parameters: int
) -> tuple[tuple[PathStructure, ...], ...]:
    kind = tuple[tuple[ProcessPath, ...], ...] if method == "procest" else tuple[tuple[RationalPath, ...], ...]
    rows: tuple[tuple[PathStructure, ...], ...] = decoded("paths", value, kind)
    paths = [path for row in rows for path in row]
    fits = len(rows) == shape[0] and all(len(row) == shape[1] for row in rows)
    if not fits or not all(0 <= path.zeros <= path.poles <= parameters for path in paths):
        raise SysidError(f"paths: expected {shape[0]} rows of {shape[1]} proper transfer functions, got {shown(value)}")
    if sum(len(path.names) for path in paths) != parameters:
        raise SysidError(f"paths: expected those of {parameters} parameters, got {shown(value)}")
    return rows


def _layout(value: Any, polynomials: Polynomials | None, names: tuple[str, ...]) -> Orders:
    orders = decoded("layout", value, Orders)
    widths = {len(orders.nb), len(orders.nf), len(orders.nk)}
    # Numbers before names, of which a damaged file can claim any number.
    counts = (orders.na, *orders.nb, orders.nc, orders.nd, *orders.nf)
    known = polynomials is not None and widths == {polynomials.nu} and min(counts) >= 0 and orders.count == len(names)
    if polynomials is None or not known or orders.names != names:
        raise SysidError(f"layout: expected that of {len(names)} parameters of polynomials, got {shown(value)}")
    if not all(0 <= k < polynomials.B.shape[-1] for k in orders.nk):
        raise SysidError(
            f"layout.nk: expected delays below the length of B, {polynomials.B.shape[-1]}, got {orders.nk}"
        )
    return orders


def _shaped(where: str, array: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Check the shape of an array from JSON, which writes an empty matrix as an empty list."""
    if not array.size and 0 in shape:
        array = array.reshape(shape)
    if shape != array.shape:
        raise SysidError(f"{where}: expected shape {shape}, got {array.shape}")
    return array

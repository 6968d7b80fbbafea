"""The model file: a model or estimate as JSON, every bit of it, described in docs/model-file.md."""

import re
from dataclasses import fields
from itertools import chain
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
from sysid.models.model_forms import Choice, chosen_model
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace, is_covariance
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arguments import file_path, shown
from sysid.records.arrays import FloatArray, real_array
from sysid.records.errors import SysidError, warn_each

FORMAT, VERSION = "sysid-model", 1
ENDING = ".json"
KINDS = {"estimate": Estimate, "state_space": StateSpace, "polynomials": Polynomials}
LARGEST = 1e150  # largest entry of a covariance: its squares are finite
HASH = re.compile(r"[0-9a-f]{64}")
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
    file = file_path(path)
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

    Warns:
        SysidWarning: Each warning of the fit that the file holds.
    """
    file = file_path(path)
    try:
        model = _model(parsed(file))
    except SysidError as error:
        raise SysidError(f"{file.name}: {error}") from error
    if isinstance(model, Estimate):
        remarks = model.diagnostics.get("warnings", ())
        warn_each(f"{file.name}: warning of the fit: {remark}" for remark in remarks)
    return model


def _model(content: Any) -> Estimate | StateSpace | Polynomials:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise SysidError(f'no model file: expected a table with "format": "{FORMAT}"')
    version = content.get("version")
    if version != VERSION or isinstance(version, bool):
        raise SysidError(f"version {shown(version)} given, expected {VERSION}: another version of the package wrote it")
    kinds = [key for key in KINDS if key in content]
    if len(kinds) != 1:
        raise SysidError(f"expected one of the keys {', '.join(KINDS)}, got {', '.join(map(shown, content))}")
    (key,) = kinds
    checked_keys("the file", content, (*HEAD, key), ("command", "fit"))
    if key == "estimate":
        return _read_estimate(content[key])
    model: StateSpace | Polynomials = decoded(key, content[key], KINDS[key])
    return model


def _estimate(e: Estimate) -> dict[str, Any]:
    names = [field.name for field in fields(Estimate) if field.name != "realise"]
    table = {name: encoded(getattr(e, name)) for name in names}
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
    table = decoded_fields("estimate", value, Estimate, realise=("layout", "derivatives", "paths", "unsampled"))
    _check_numbers(table)
    _check_data(table["data"], table["model"], sampled="derivatives" not in value)
    forms = [key for key in ("layout", "derivatives", "paths") if key in value]
    realise: Realise | LinearEntries
    if forms == ["paths"] and "unsampled" not in value:
        return _of_paths(value["paths"], table)
    if forms == ["layout"]:
        realise = _of_layout(value["layout"], table)
    elif forms == ["derivatives"]:
        realise = _of_derivatives(value["derivatives"], table)
    else:
        raise SysidError("expected one of layout, of an estimate of polynomials, derivatives, and paths")
    estimate = Estimate(**table, realise=realise)
    if "unsampled" not in value:
        return estimate
    unsampled = value["unsampled"]
    checked_keys("unsampled", unsampled, ("intersample", "noise"))
    if unsampled["intersample"] not in ("zoh", "foh") or not isinstance(unsampled["noise"], bool):
        raise SysidError(f"unsampled: expected intersample zoh or foh and noise true or false, got {shown(unsampled)}")
    return continuous_estimate(estimate, Unsampled(realise, **unsampled))


def _check_numbers(table: dict[str, Any]) -> None:
    """Check parameters, covariances and residuals, and bring the arrays of a table to their shapes."""
    data, ny = table["data"], table["model"].ny
    p = len(real_array("parameters", table["parameters"]))
    if len(data.samples) != len(data.names) or min(data.samples, default=-1) < 0:
        raise SysidError(f"data: expected a number of samples for each of the names, got {shown(data.samples)}")
    samples = sum(data.samples)
    for name, shape in (("covariance", (p, p)), ("noise_variance", (ny, ny)), ("residuals", (samples, ny))):
        table[name] = _shaped(name, table[name], shape)
        largest = np.abs(table[name]).max(initial=0.0)  # NaN where the covariance is not known
        if name != "residuals" and not (np.isnan(largest) or (largest <= LARGEST and is_covariance(table[name]))):
            raise SysidError(f"{name}: expected a symmetric matrix without negative eigenvalues, up to {LARGEST:g}")


def _check_data(data: Any, model: StateSpace, *, sampled: bool) -> None:
    """Check what an estimate says of its data against its model."""
    if data.dt != model.dt and sampled:
        raise SysidError(f"data.dt: expected {model.dt:g} s as the model, got {data.dt:g}")
    if data.intersample not in ("zoh", "foh", "bl"):
        raise SysidError(f"data.intersample: expected zoh, foh or bl, got {shown(data.intersample)}")
    if len(data.hashes) not in (0, len(data.samples)) or not all(map(HASH.fullmatch, data.hashes)):
        raise SysidError(
            f"data.hashes: expected 64 hexadecimal digits per experiment, or none, got {shown(data.hashes)}"
        )
    per_channel: dict[str, tuple[Any, int]] = {}
    for name, labels in data.labels.items():
        per_channel[name] = (labels, len(getattr(model, name)))
    per_channel["input_offset"] = (data.input_offset, model.nu)
    per_channel["output_offset"] = (data.output_offset, model.ny)
    per_channel["output_deviation"] = (data.output_deviation or None, model.ny)
    for name, (values, count) in per_channel.items():
        if values is not None and len(values) != count:
            raise SysidError(f"data.{name}: expected {count}, one per channel of the model, got {len(values)}")


def _of_paths(value: Any, table: dict[str, Any]) -> ContinuousEstimate:
    """Estimate of transfer functions in continuous time, whose discrete model must be that of the table."""
    model, data, theta = table["model"], table["data"], table["parameters"]
    structures = _structures(value, table["method"], (model.ny, model.nu), len(theta))
    continuous = RealisePaths(structures, data, data.intersample, model.innovation_covariance)
    sampled = Resampled(continuous)
    expected, got = entries(model), entries(sampled(theta))
    # matrix exponentials differ by rounding from machine to machine
    if expected.shape != got.shape or not np.allclose(got, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()):
        raise SysidError("paths: the transfer functions with these parameters are not the model")
    return ContinuousEstimate(**table, realise=sampled, realise_continuous=continuous)


def _of_layout(value: Any, table: dict[str, Any]) -> Realise:
    """Polynomials of the parameters, whose model must be that of the table."""
    model = table["model"]
    orders = _layout(value, table["polynomials"], table["parameter_names"])
    variance = None if model.innovation_covariance is None else float(table["noise_variance"][0, 0])
    realise = Realise(orders, table["data"], variance)
    if not np.array_equal(entries(realise(table["parameters"])), entries(model)):
        raise SysidError("layout: the polynomials with these parameters are not the model")
    return realise


def _of_derivatives(value: Any, table: dict[str, Any]) -> LinearEntries:
    """Rebuild a model that is linear in its parameters, from its stored derivatives."""
    model, theta = table["model"], table["parameters"]
    moves = decoded("derivatives", value, FloatArray | None)
    if moves is not None:
        moves = _shaped("derivatives", moves, (len(theta), len(entries(model))))
    return LinearEntries(model, theta, moves)


def _structures(
    value: Any, method: str, shape: tuple[int, int], parameters: int
) -> tuple[tuple[PathStructure, ...], ...]:
    of_processes, of_fractions = tuple[tuple[ProcessPath, ...], ...], tuple[tuple[RationalPath, ...], ...]
    expected = of_processes if method == "procest" else of_fractions
    rows: tuple[tuple[PathStructure, ...], ...] = decoded("paths", value, expected)
    paths = list(chain.from_iterable(rows))
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
    fits = polynomials is not None and widths == {polynomials.nu} and min(counts) >= 0 and orders.count == len(names)
    if polynomials is None or not fits or orders.names != names:
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

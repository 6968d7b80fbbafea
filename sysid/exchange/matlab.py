"""A model as a MATLAB function that constructs it: idpoly or idss."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from sysid.exchange.files import heading, named_path, operating_point, write_whole
from sysid.exchange.parameters import entries, entry_moves, portable, with_entries
from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials
from sysid.models.predict import as_model
from sysid.models.state_space import StateSpace
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError


def to_matlab(model: StateSpace | Estimate, path: str | Path) -> Path:
    """Write a MATLAB function that returns the model: `sys = servo` of servo.m constructs an idpoly or idss object.

    Estimates of polynomials become `idpoly`, all others `idss`, with names, units, `NoiseVariance` and the covariance
    (`setcov`); of state-space estimates the latter is that of the entries of the matrices. An operating point that the
    estimate knows is in `sys.UserData`. The System Identification Toolbox runs the function.

    Args:
        model: A model or estimate.
        path: Where to write, servo.m.

    Returns:
        The file.

    Raises:
        SysidError: A name that is no identifier, channels whose names or units do not fit on a line.
    """
    file = named_path(path, ".m")
    m = as_model(model)
    labels = [
        f"'{key}', {{{', '.join(map(_text, texts or ()))}}}"
        for key, texts in (
            ("InputName", m.input_names),
            ("OutputName", m.output_names),
            ("InputUnit", m.input_units),
            ("OutputUnit", m.output_units),
        )
        if texts
    ]
    known = isinstance(model, Estimate) and np.isfinite(model.covariance).all() and len(model.parameters) > 0
    # A model with the numbers of the parameters in their places shows where MATLAB puts them among its own.
    if isinstance(model, Estimate) and model.polynomials is not None and isinstance(by := portable(model), Realise):
        count = len(model.parameters)
        shape = by.orders.polynomials(np.arange(1.0, count + 1.0))
        rest = [_matrix(model.noise_variance), repr(m.dt), *labels]
        call, numbered = (_idpoly(polynomials, shape, rest) for polynomials in (model.polynomials, shape))
        covariance = model.covariance
    else:
        call, count = _idss(m, labels), len(entries(m))
        numbered = _idss(with_entries(m, np.arange(1.0, count + 1.0)), labels)
        if known and isinstance(model, Estimate):
            moves = entry_moves(model)
            covariance = moves.T @ moves
    lines = [f"% {heading(model)}", f"sys = {call};"]
    if known:
        lines += [
            f"covariance = {_matrix(covariance)};",
            "% The same model with the number of each parameter in its place: where getpvec has it, setcov wants it.",
            f"[known, number] = ismember(getpvec({numbered}), 1:{count});",
            "whole = zeros(numel(known));",
            "whole(known, known) = covariance(number(known), number(known));",
            "sys = setcov(sys, whole);",
        ]
    levels = operating_point(model)
    if any(level.any() for level in levels):
        inputs, outputs = map(_row, levels)
        lines.append(f"sys.UserData = struct('InputOffset', {inputs}, 'OutputOffset', {outputs});")
    text = "\n".join((f"function sys = {file.stem}()", *lines, "end", ""))
    write_whole(file, text.encode("utf-8"))
    return file


def _idpoly(p: Polynomials, shape: Polynomials, rest: list[str]) -> str:
    """The constructor, with as many coefficients as `shape` has: some may be zero."""
    rows: dict[str, str] = {}
    for name, k in (("B", 0), ("F", 1)):
        values = np.atleast_2d(getattr(p, name))
        texts = [_row(values[j, : len(shape.channel(j)[k])]) for j in range(p.nu)]
        rows[name] = texts[0] if p.nu == 1 else f"{{{', '.join(texts)}}}" if texts else "[]"
    return _call("idpoly", [_row(p.A), rows["B"], _row(p.C), _row(p.D), rows["F"], *rest])


def _idss(m: StateSpace, labels: list[str]) -> str:
    covariance = m.innovation_covariance
    noise = [] if covariance is None else [f"'NoiseVariance', {_matrix(covariance)}"]
    matrices = [_matrix(matrix) for matrix in (m.A, m.B, m.C, m.D, m.gain, np.zeros((m.order, 1)))]
    return _call("idss", [*matrices, repr(m.dt), *noise, *labels])


def _call(name: str, arguments: Iterable[str]) -> str:
    return f"{name}({', '.join(arguments)}, 'TimeUnit', 'seconds')"


def _row(values: FloatArray) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _matrix(matrix: FloatArray) -> str:
    if not matrix.size:
        return f"zeros({len(matrix)}, {matrix.shape[1]})"
    return f"[{'; '.join(_row(row)[1:-1] for row in matrix)}]"


def _text(text: str) -> str:
    if not text.isprintable():
        raise SysidError(f"the label {text!r} of a channel does not fit on a line of MATLAB; expected printable text")
    doubled = text.replace("'", "''")
    return f"'{doubled}'"

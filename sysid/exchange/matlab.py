"""A model as a MATLAB function that constructs it: idpoly, idtf or idss."""

from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from sysid.continuous.path_response import TransferFunction
from sysid.continuous.structures import RationalPath, RealisePaths
from sysid.exchange.files import heading, named_path, operating_point, write_whole
from sysid.exchange.parameters import entries, entry_moves, portable, with_entries
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model, chosen_model
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError


def to_matlab(model: StateSpace | Estimate, path: str | Path) -> Path:
    """Write a MATLAB function that returns the model: `sys = servo` of servo.m constructs an identified model.

    Estimates of polynomials become `idpoly`, those of `tfest`, `procest` and `fit_response` in continuous time `idtf`
    with `IODelay`, all others `idss` in discrete time, with names, units, `NoiseVariance` and the covariance
    (`setcov`): of `idtf` that of coefficients and delays, of `idss` that of the entries of the matrices. An operating
    point that the estimate knows is in `sys.UserData`. The System Identification Toolbox runs the function.

    Args:
        model: A model or estimate.
        path: Where to write, servo.m.

    Returns:
        The file.

    Raises:
        SysidError: A name that is no identifier, channels whose names or units do not fit on a line.
    """
    file = named_path(path, ".m")
    model = chosen_model(model)
    m = as_model(model)
    labels = _labels(m)
    has_covariance = isinstance(model, Estimate) and np.isfinite(model.covariance).all() and len(model.parameters) > 0
    free: list[str] = []
    # A model with the numbers of the parameters in their places shows where MATLAB puts them among its own; they begin
    # at 2, since polynomials have leading ones.
    if isinstance(model, Estimate) and model.polynomials is not None and isinstance(by := portable(model), Realise):
        count = len(model.parameters)
        shape = by.orders.polynomials(np.arange(2.0, count + 2.0))
        rest = [_matrix(model.noise_variance), repr(m.dt), *labels]
        call, numbered = _idpoly(model.polynomials, shape, rest), _idpoly(shape, shape, rest)
        covariance = model.covariance
    elif isinstance(model, ContinuousEstimate) and isinstance(paths := model.realise_continuous, RealisePaths):
        call, numbered, moves = _idtf(model, paths, labels)
        covariance, count = moves.T @ moves, moves.shape[1]
        free = _free_delays(paths)
    else:
        call, count = _idss(m, labels), len(entries(m))
        numbered = _idss(with_entries(m, np.arange(2.0, count + 2.0)), labels)
        if has_covariance and isinstance(model, Estimate):
            moves = entry_moves(model)
            covariance = moves.T @ moves
    lines = [f"% {heading(model)}", f"sys = {call};", *free]
    if has_covariance:
        lines += _covariance_lines(covariance, numbered, count)
    levels = operating_point(model)
    if any(level.any() for level in levels):
        inputs, outputs = map(_row, levels)
        lines.append(f"sys.UserData = struct('InputOffset', {inputs}, 'OutputOffset', {outputs});")
    source = "\n".join((f"function sys = {file.stem}()", *lines, "end", ""))
    write_whole(file, source.encode("utf-8"))
    return file


def _labels(m: StateSpace) -> list[str]:
    """Names and units of the channels as arguments of a constructor."""
    labels = {
        "InputName": m.input_names,
        "OutputName": m.output_names,
        "InputUnit": m.input_units,
        "OutputUnit": m.output_units,
    }
    arguments = []
    for key, names in labels.items():
        if names:
            arguments += [f"'{key}'", _cell_row(map(_text, names))]
    return arguments


def _free_delays(paths: RealisePaths) -> list[str]:
    """Lines that free the delays which were estimated; idtf holds those that are given."""
    lines = []
    for i, row in enumerate(paths.structures, start=1):
        for j, path in enumerate(row, start=1):
            if path.delay is None:
                lines.append(f"sys.Structure({i}, {j}).IODelay.Free = true;")
    return lines


def _covariance_lines(covariance: FloatArray, numbered: str, count: int) -> list[str]:
    """Lines that set the covariance of the parameters, in the sequence in which MATLAB has them."""
    return [
        f"covariance = {_matrix(covariance)};",
        "% The same model with the number of each parameter in its place: where getpvec has it, setcov wants it.",
        f"[known, number] = ismember(getpvec({numbered}), 2:{count + 1});",
        "whole = zeros(numel(known));",
        "whole(known, known) = covariance(number(known), number(known));",
        "sys = setcov(sys, whole);",
    ]


def _idpoly(p: Polynomials, shape: Polynomials, rest: list[str]) -> str:
    """The constructor, with as many coefficients as `shape` has: some may be zero."""
    rows: dict[str, str] = {}
    for name, k in (("B", 0), ("F", 1)):
        values = np.atleast_2d(getattr(p, name))
        of_inputs = []
        for j in range(p.nu):
            length = len(shape.channel(j)[k])
            of_inputs.append(_row(values[j, :length]))
        if p.nu == 1:
            rows[name] = of_inputs[0]
        else:
            rows[name] = _cell_row(of_inputs) if of_inputs else "[]"
    return _call("idpoly", [_row(p.A), rows["B"], _row(p.C), _row(p.D), rows["F"], *rest])


def _idss(m: StateSpace, labels: list[str]) -> str:
    covariance = m.innovation_covariance
    noise = [] if covariance is None else [f"'NoiseVariance', {_matrix(covariance)}"]
    start = np.zeros((m.order, 1))
    matrices = list(map(_matrix, (m.A, m.B, m.C, m.D, m.gain, start)))
    return _call("idss", [*matrices, repr(m.dt), *noise, *labels])


def _idtf(estimate: Estimate, paths: RealisePaths, labels: list[str]) -> tuple[str, str, FloatArray]:
    """The constructor, that with numbers of coefficients, and changes of these per standard direction."""
    ny, nu = len(paths.structures), len(paths.structures[0])
    shape = []
    for structure in chain.from_iterable(paths.structures):
        delay = None if structure.delay is None else 0.0
        shape.append(RationalPath(structure.poles, structure.zeros, delay))

    def coefficients(theta: FloatArray) -> FloatArray:
        pairs = zip(shape, paths.transfers(theta), strict=True)
        return np.concatenate([structure.parameters(path) for structure, path in pairs])

    def cells(polynomials: Iterable[FloatArray]) -> str:
        # MATLAB has the highest power first.
        written = [_row(polynomial[::-1]) for polynomial in polynomials]
        rows = [", ".join(written[i * nu : (i + 1) * nu]) for i in range(ny)]
        return f"{{{'; '.join(rows)}}}"

    def constructor(transfers: Sequence[TransferFunction]) -> str:
        numerators, denominators = cells(g.b for g in transfers), cells(g.a for g in transfers)
        delays = _matrix(np.reshape([g.delay for g in transfers], (ny, nu)))
        noise = [] if paths.covariance is None else ["'NoiseVariance'", _matrix(paths.covariance)]
        return _call("idtf", [numerators, denominators, "0", "'IODelay'", delays, *noise, *labels])

    # The leading coefficient of a denominator of idtf is 1.
    monic = []
    for g in paths.transfers(estimate.parameters):
        monic.append(TransferFunction(g.b / g.a[-1], g.a / g.a[-1], g.delay))
    ends = np.cumsum([len(structure.names) for structure in shape])
    numbers_of_paths = np.split(np.arange(2.0, ends[-1] + 2.0), ends[:-1])
    numbered = [structure.transfer(numbers) for structure, numbers in zip(shape, numbers_of_paths, strict=True)]
    return constructor(monic), constructor(numbered), spread(coefficients, estimate.parameters, estimate.covariance)


def _call(name: str, arguments: Iterable[str]) -> str:
    return f"{name}({', '.join(arguments)}, 'TimeUnit', 'seconds')"


def _cell_row(cells: Iterable[str]) -> str:
    return f"{{{', '.join(cells)}}}"


def _row(values: FloatArray) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _matrix(matrix: FloatArray) -> str:
    if not matrix.size:
        return f"zeros({len(matrix)}, {matrix.shape[1]})"
    return f"[{'; '.join(_row(row)[1:-1] for row in matrix)}]"


def _text(label: str) -> str:
    if not label.isprintable():
        raise SysidError(f"the label {label!r} of a channel does not fit on a line of MATLAB; expected printable text")
    doubled = label.replace("'", "''")
    return f"'{doubled}'"

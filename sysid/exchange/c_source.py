"""C source of a model: C99, a header and one file, no memory allocated."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template

from sysid.exchange.files import comment, heading, named_path, operating_point, write_whole
from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError


def to_c(model: StateSpace | Estimate, path: str | Path) -> tuple[Path, Path]:
    """Write the path from u to y as C source: `servo_start`, `servo_output` and `servo_step` of servo.c and servo.h.

    Noise dynamics are left out; the state starts at zero, as in `simulate`. Inputs and outputs are signals about the
    operating point that the estimate knows, fields `u0` and `y0` of the model, zero otherwise.

    Args:
        model: A model or estimate.
        path: Where to write, servo.c; the name is the prefix of the functions.

    Returns:
        The source and the header beside it.

    Raises:
        SysidError: A name that is no identifier, a time series without input.
    """
    source = named_path(path, ".c")
    header = source.with_suffix(".h")
    contents = c_files(model, source.stem)
    for file in (source, header):
        write_whole(file, contents[file.name])
    return source, header


def c_files(model: StateSpace | Estimate, name: str) -> dict[str, bytes]:
    """Source and header of a model, by name of the file."""
    values = c_values(model, name)
    return {f"{name}.{ending}": filled(f"model.{ending}", values) for ending in ("c", "h")}


def c_values(model: StateSpace | Estimate, name: str) -> dict[str, object]:
    """Values of the placeholders in the templates."""
    about, (u0, y0) = heading(model), operating_point(model)
    if not as_model(model).nu:
        raise SysidError("the model is of a time series, without input; expected a path from u to y to export")
    m = as_model(model).input_path()
    channels = _channel_lines("u", m.input_names, m.input_units)
    channels += _channel_lines("y", m.output_names, m.output_units)
    matrices = {letter: _numbers(getattr(m, letter).ravel()) for letter in "ABCD"}
    return {
        "about": about,
        "channels": "\n".join(channels),
        "name": name,
        "NAME": name.upper(),
        "dt": repr(m.dt),
        "states": m.order,
        "inputs": m.nu,
        "outputs": m.ny,
        # C has no arrays of length zero
        "room_x": max(m.order, 1),
        "room_u": max(m.nu, 1),
        "room_y": m.ny,
        **matrices,
        "x0": "0.0",
        "u0": _numbers(u0),
        "y0": _numbers(y0),
    }


def _channel_lines(letter: str, names: Sequence[str] | None, units: Sequence[str] | None) -> list[str]:
    """Lines of a comment that name the elements of an array."""
    lines: list[str] = []
    for name, unit in zip(names or (), units or (), strict=True):
        lines.append(f"   {letter}[{len(lines)}]: {comment(name)} [{comment(unit)}]")
    return lines


def filled(template: str, values: dict[str, object]) -> bytes:
    """A template of this room with its placeholders filled in."""
    source = Path(__file__).with_name(template).read_text(encoding="utf-8")
    return Template(source).substitute(values).encode("ascii")


def _numbers(values: Iterable[float] | FloatArray) -> str:
    """Shortest decimals that a compiler turns back into the same numbers."""
    return ", ".join(repr(float(value)) for value in values) or "0.0"

"""Parameters of continuous-time models that are known: `fixed=` of `tfest` and `procest`."""

import math
from collections.abc import Mapping, Sequence

from sysid.continuous.structures import PathStructure, RationalPath
from sysid.records.arguments import real_number, shown
from sysid.records.errors import SysidError

Known = Mapping[int, float]  # values of the parameters of one output that are known, by index


def known_parameters(
    fixed: Mapping[str, float] | None, names: Sequence[str], rows: Sequence[Sequence[PathStructure]]
) -> list[Known]:
    """Known values among the parameters of each output, by index; empty without any.

    Args:
        fixed: Values by the name of the parameter, as in the result; None for none.
        names: Names of all parameters, output by output.
        rows: Structures of the paths, one row per output.

    Raises:
        SysidError: Another name, a value that is no finite number or that the parameter cannot have, a delay of
            `tfest`, or nothing that remains to be estimated.
    """
    if fixed is None:
        return [{} for _ in rows]
    if not isinstance(fixed, Mapping):
        raise SysidError(f'fixed: expected values by parameter, e.g. {{"{names[0]}": 1.0}}, got {shown(fixed)}')
    unknown = [name for name in fixed if name not in names]
    if unknown:
        raise SysidError(f"fixed: expected parameters among {', '.join(names)}, got {shown(unknown[0])}")
    by_output: list[Known] = []
    begin = 0
    for row in rows:
        known, k = {}, 0
        for structure in row:
            for own_name in structure.names:
                name = names[begin + k]
                if name in fixed:
                    known[k] = _checked_value(name, own_name, fixed[name], structure)
                k += 1
        if len(known) == k:
            raise SysidError("fixed holds every parameter of an output, expected at least one that is estimated")
        begin += k
        by_output.append(known)
    return by_output


def _checked_value(name: str, own_name: str, value: object, structure: PathStructure) -> float:
    """A value that the parameter can have: finite, and of a pole that is stable."""
    known = real_number(f"fixed: {name}", value, "be a finite number", math.isfinite)
    if isinstance(structure, RationalPath):
        if own_name == "Td":
            raise SysidError(f"fixed: {name}: expected a known delay as delay={known:g}, which takes it as given")
        if own_name.startswith("a") and known <= 0.0:
            # all coefficients of a monic denominator are positive if its poles are on the left
            raise SysidError(
                f"fixed: {name}: expected a coefficient > 0, as every stable denominator has, got {known:g}"
            )
        return known
    if own_name == "Td" and known < 0.0:
        raise SysidError(f"fixed: {name}: expected a delay >= 0 in s, got {known:g}")
    if own_name.startswith("Kp") and known == 0.0:
        raise SysidError(f"fixed: {name}: expected a gain other than 0, without which nothing else of the path shows")
    if own_name.startswith(("Tp", "Tw", "Zeta")) and known <= 0.0:
        raise SysidError(f"fixed: {name}: expected a value > 0, as every stable model has, got {known:g}")
    return known

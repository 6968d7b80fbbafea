"""Arms drawn at random: from which distributions, and one arm of many by its seed."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import exp, inf, isfinite, log
from numbers import Real
from types import MappingProxyType
from typing import Any
from zlib import crc32

import numpy as np

from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.specimen import DEVIATIONS, LENGTHS, Specimen

KINDS = ("fixed", "normal", "uniform", "lognormal")
"""What a distribution may be."""

CUT = 4.0
"""Normal numbers beyond it are drawn anew, one in 16,000: so every draw is an arm that can be."""


LARGEST = 700.0
"""The exponential of a larger number is taken for infinite."""


@dataclass(frozen=True)
class Distribution:
    """How one quantity scatters over arms.

    Attributes:
        kind: ``"fixed"`` at the centre; ``"normal"`` or ``"uniform"`` about it; ``"lognormal"``, its logarithm normal
            about that of the centre. Normal ones are cut at `CUT` standard deviations.
        spread: Standard deviation of a normal one, half the width of a uniform one, standard deviation of the natural
            logarithm of a lognormal one; in the quantity's unit, but for the last. None of a fixed one.
        centre: Mean, middle or median; the nominal value of the quantity by default.

    Raises:
        TwinError: No such kind, no such spread, or a lognormal one about a centre that is not above 0.
    """

    kind: str
    spread: float = 0.0
    centre: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in KINDS:
            raise TwinError(f"unknown kind {self.kind!r} of distribution, available: {', '.join(KINDS)}")
        for name in ("spread", "centre"):
            value = getattr(self, name)
            if value is None and name == "centre":
                continue
            if isinstance(value, bool) or not isinstance(value, Real) or not isfinite(float(value)):
                raise TwinError(f"{name} = {value!r} of a distribution given, expected a finite number")
            object.__setattr__(self, name, float(value))
        if (self.spread == 0.0) != (self.kind == "fixed") or self.spread < 0.0:
            wanted = "none" if self.kind == "fixed" else "above 0"
            raise TwinError(f"spread = {self.spread:g} of a {self.kind} distribution given, expected {wanted}")
        if self.kind == "lognormal" and self.centre is not None and self.centre <= 0.0:
            raise TwinError(f"centre = {self.centre:g} of a lognormal distribution given, expected above 0")

    def support(self) -> tuple[float, float]:
        """Return the smallest and the largest number that can be drawn, of a distribution whose centre is stated."""
        return self._at(-CUT), self._at(CUT)

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw numbers (count,), of a distribution whose centre is stated."""
        if self.kind == "fixed":
            return np.full(count, self._middle)
        if self.kind == "uniform":
            return self._middle + self.spread * rng.uniform(-1.0, 1.0, count)
        normal = rng.standard_normal(count)
        while (beyond := np.abs(normal) > CUT).any():
            normal[beyond] = rng.standard_normal(int(beyond.sum()))
        return np.array([self._at(float(number)) for number in normal])

    @property
    def _middle(self) -> float:
        if self.centre is None:
            raise TwinError("a distribution without a centre asked for numbers, expected one that states it")
        return self.centre

    def _at(self, number: float) -> float:
        """The value at a standard normal number; of a uniform distribution, the nearest there is."""
        if self.kind == "lognormal":
            exponent = log(self._middle) + self.spread * number
            return exp(exponent) if exponent < LARGEST else inf
        return self._middle + self.spread * (number if self.kind == "normal" else float(np.clip(number, -1.0, 1.0)))


@dataclass(frozen=True)
class TwinDistributions:
    """How the arms of a population differ: one distribution per quantity, none where it is what the scenario says.

    Every number of a quantity, such as the factors of the seven joints, is drawn on its own. The first twelve are those
    of `Specimen`: `stretch`, `shear` and `shift` scatter in the space of its log-Cholesky matrix, where every draw is a
    body that can be built. The last four are those of `Plant`.

    Raises:
        TwinError: Something that is no `Distribution`, or one that would draw what no arm can be.
    """

    mass: Distribution | None = None
    stretch: Distribution | None = None
    shear: Distribution | None = None
    shift: Distribution | None = None
    payload_mass: Distribution | None = None
    dry_friction: Distribution | None = None
    drag: Distribution | None = None
    kp: Distribution | None = None
    kd: Distribution | None = None
    bulk_modulus: Distribution | None = None
    leakage: Distribution | None = None
    resolver_noise: Distribution | None = None
    supply_pressure: Distribution | None = None
    oil_temperature: Distribution | None = None
    friction_level: Distribution | None = None
    process_noise: Distribution | None = None

    def __post_init__(self) -> None:
        for name, given in vars(self).items():
            if given is None:
                continue
            if not isinstance(given, Distribution):
                raise TwinError(f"{name} = {given!r} given, expected a Distribution")
            try:
                stated = given if given.centre is not None else replace(given, centre=_nominal(name))
            except TwinError as error:
                raise TwinError(f"{name}: {error}") from error
            object.__setattr__(self, name, stated)
            try:
                for value in stated.support():
                    _check(name, value)
            except TwinError as error:
                lower, upper = stated.support()
                raise TwinError(f"{name} from {lower:.4g} to {upper:.4g} would be drawn: {error}") from error

    @property
    def stated(self) -> Mapping[str, Distribution]:
        """The distributions there are, by the name of the quantity."""
        return MappingProxyType({name: value for name, value in vars(self).items() if value is not None})

    @classmethod
    def from_table(cls, table: object) -> "TwinDistributions":
        """Read them from a parsed TOML table, strictly: one table of `kind`, `spread` and `centre` per quantity.

        Raises:
            TwinError: No table, an unknown quantity or key, or a distribution that cannot be.
        """
        values: dict[str, Distribution] = {}
        for name, given in _entries("distributions", table, cls).items():
            entries = _entries(name, given, Distribution)
            if "kind" not in entries:
                raise TwinError(f"{name} without a kind given, expected one of {', '.join(KINDS)}")
            try:
                values[name] = Distribution(**entries)
            except TwinError as error:
                raise TwinError(f"{name}: {error}") from error
        return cls(**values)

    def to_toml(self) -> str:
        """Write them as the lines of a TOML table, such that `from_table` gives equal ones back."""
        lines = []
        for name, given in self.stated.items():
            entries = [f'kind = "{given.kind}"']
            if given.spread:
                entries.append(f"spread = {given.spread!r}")
            if given.centre != _nominal(name):
                entries.append(f"centre = {given.centre!r}")
            lines.append(f"{name} = {{ {', '.join(entries)} }}\n")
        return "".join(lines)


def draw_specimen(
    distributions: TwinDistributions, seed_sequence: np.random.SeedSequence
) -> tuple[Specimen, Mapping[str, float]]:
    """Draw one arm.

    Each quantity has a random stream of its own, which its name picks: a distribution more or less changes nothing of
    the others, nor does the order in which they are named.

    Args:
        distributions: How arms differ.
        seed_sequence: That of this one arm; it is left as it is.

    Returns:
        The specimen, and by name what changes of its `Plant`.
    """
    found: dict[str, Any] = {}
    for name, distribution in distributions.stated.items():
        stream = np.random.SeedSequence(
            seed_sequence.entropy,
            spawn_key=(*seed_sequence.spawn_key, crc32(name.encode())),
            pool_size=seed_sequence.pool_size,
        )
        numbers = distribution.draw(LENGTHS.get(name, 1), np.random.Generator(np.random.PCG64(stream)))
        found[name] = tuple(map(float, numbers)) if name in LENGTHS else float(numbers[0])
    of_plant = {name: found.pop(name) for name in list(found) if name not in _OF_SPECIMEN}
    return Specimen(**found), MappingProxyType(of_plant)


_OF_SPECIMEN = frozenset(entry.name for entry in fields(Specimen))


def _nominal(name: str) -> float:
    if name in _OF_SPECIMEN:
        return 0.0 if name in DEVIATIONS else 1.0
    return float(getattr(Plant, name))


def _check(name: str, value: float) -> None:
    """Refuse a value that a specimen or a plant cannot have."""
    if name not in _OF_SPECIMEN:
        Plant(**{name: value})  # type: ignore[arg-type]
    elif name in LENGTHS:
        Specimen(**{name: (value,) * LENGTHS[name]})  # type: ignore[arg-type]
    else:
        Specimen(**{name: value})  # type: ignore[arg-type]


def _entries(key: str, table: object, kind: type) -> dict[str, Any]:
    known = [entry.name for entry in fields(kind)]
    if not isinstance(table, Mapping):
        raise TwinError(f"{key} = {table!r} given, expected a table of {', '.join(known)}")
    for name in table:
        if name not in known:
            raise TwinError(f"{key}: unknown key {name!r}, available: {', '.join(known)}")
    return dict(table)

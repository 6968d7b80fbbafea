"""Random arms: distributions of their parameters, and the arm that a seed draws from them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import exp, inf, isfinite, log
from types import MappingProxyType
from typing import Any
from zlib import crc32

import numpy as np

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.real_number import real_number
from hmtb_twin.parameters.specimen import DEVIATIONS, LENGTHS, Specimen

KINDS = ("fixed", "normal", "uniform", "lognormal")
"""Kinds of distributions."""

CUT = 4.0
"""Truncation of normal numbers, in standard deviations; one in 16,000 is redrawn, so that every arm is valid."""

LARGEST = 700.0
"""Exponent above which the exponential overflows and counts as infinite."""


@dataclass(frozen=True)
class Distribution:
    """Distribution of one quantity over arms.

    Attributes:
        kind: ``"fixed"`` at the centre; ``"normal"`` or ``"uniform"`` about it; ``"lognormal"``, its logarithm normal
            about that of the centre. Normal numbers are truncated at `CUT` standard deviations.
        spread: Standard deviation if normal, half the width if uniform, standard deviation of the natural logarithm if
            lognormal, 0 if fixed; in the quantity's unit, except for lognormal.
        centre: Mean, middle or median; the nominal value of the quantity by default.

    Raises:
        TwinError: Unknown kind, invalid spread, or a lognormal distribution whose centre is not above 0.
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
            if not isfinite(real_number(value)):
                raise TwinError(f"{name} = {shown(value)} of a distribution given, expected a finite number")
            object.__setattr__(self, name, float(value))
        if (self.spread == 0.0) != (self.kind == "fixed") or self.spread < 0.0:
            expected = "none" if self.kind == "fixed" else "above 0"
            raise TwinError(f"spread = {self.spread:g} of a {self.kind} distribution given, expected {expected}")
        if self.kind == "lognormal" and self.centre is not None and self.centre <= 0.0:
            raise TwinError(f"centre = {self.centre:g} of a lognormal distribution given, expected above 0")

    def support(self) -> tuple[float, float]:
        """Return the smallest and the largest possible number; needs a stated centre."""
        return self._at(-CUT), self._at(CUT)

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw numbers (count,); needs a stated centre."""
        if self.kind == "fixed":
            return np.full(count, self._middle)
        if self.kind == "uniform":
            return self._middle + self.spread * rng.uniform(-1.0, 1.0, count)
        normal = rng.standard_normal(count)
        # Redrawn rather than clipped: clipping would heap arms at the bounds.
        while (outside := np.abs(normal) > CUT).any():
            normal[outside] = rng.standard_normal(int(outside.sum()))
        return np.array([self._at(float(deviation)) for deviation in normal])

    @property
    def _middle(self) -> float:
        """The centre; raises `TwinError` where none is stated."""
        if self.centre is None:
            raise TwinError("numbers requested of a distribution without a centre, expected a stated centre")
        return self.centre

    def _at(self, deviation: float) -> float:
        """Return the value at a standard normal deviation; of a uniform distribution, the nearest possible one."""
        if self.kind == "lognormal":
            exponent = log(self._middle) + self.spread * deviation
            return exp(exponent) if exponent < LARGEST else inf
        if self.kind != "normal":
            deviation = float(np.clip(deviation, -1.0, 1.0))
        return self._middle + self.spread * deviation


@dataclass(frozen=True)
class TwinDistributions:
    """Distributions of the parameters of a population of arms; quantities without one keep the scenario's value.

    Every number of a quantity, such as the factors of the seven joints, is drawn independently. The first twelve are
    those of `Specimen`: `stretch`, `shear` and `shift` are drawn in the space of its log-Cholesky matrix, where every
    draw is a physically possible body. The last four are those of `Plant`.

    Raises:
        TwinError: Something other than a `Distribution`, or one that would draw an impossible arm.
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
        for name, distribution in vars(self).items():
            if distribution is None:
                continue
            if not isinstance(distribution, Distribution):
                raise TwinError(f"{name} = {distribution!r} given, expected a Distribution")
            if distribution.centre is None:
                try:
                    distribution = replace(distribution, centre=_nominal(name))
                except TwinError as error:
                    raise TwinError(f"{name}: {error}") from error
            object.__setattr__(self, name, distribution)
            # A draw that fails on one arm in thousands would show only late: the extremes must be possible arms.
            lower, upper = distribution.support()
            try:
                _check(name, lower)
                _check(name, upper)
            except TwinError as error:
                raise TwinError(f"{name} from {lower:.4g} to {upper:.4g} would be drawn: {error}") from error

    @property
    def stated(self) -> Mapping[str, Distribution]:
        """The stated distributions by the name of their quantity."""
        return MappingProxyType({name: value for name, value in vars(self).items() if value is not None})

    @classmethod
    def from_table(cls, table: object) -> "TwinDistributions":
        """Read distributions from a parsed TOML table: one table of `kind`, `spread` and `centre` per quantity.

        Raises:
            TwinError: No table, an unknown quantity or key, or an invalid distribution.
        """
        distributions: dict[str, Distribution] = {}
        for name, value in _checked_table("distributions", table, cls).items():
            settings = _checked_table(name, value, Distribution)
            if "kind" not in settings:
                raise TwinError(f"{name} without a kind given, expected one of {', '.join(KINDS)}")
            try:
                distributions[name] = Distribution(**settings)
            except TwinError as error:
                raise TwinError(f"{name}: {error}") from error
        return cls(**distributions)

    def to_toml(self) -> str:
        """Write the distributions as the lines of a TOML table that `from_table` reads back equal."""
        lines = []
        for name, distribution in self.stated.items():
            settings = [f'kind = "{distribution.kind}"']
            if distribution.spread:
                settings.append(f"spread = {distribution.spread!r}")
            if distribution.centre != _nominal(name):
                settings.append(f"centre = {distribution.centre!r}")
            lines.append(f"{name} = {{ {', '.join(settings)} }}\n")
        return "".join(lines)


def draw_specimen(
    distributions: TwinDistributions, seed_sequence: np.random.SeedSequence
) -> tuple[Specimen, Mapping[str, float]]:
    """Draw one arm.

    Each quantity has its own random stream, selected by its name: adding or removing one does not change the others.

    Args:
        distributions: The distributions.
        seed_sequence: Seed of this arm; it is not advanced.

    Returns:
        The specimen, and the changed values of its `Plant` by name.
    """
    values: dict[str, Any] = {}
    for name, distribution in distributions.stated.items():
        # The CRC of the name, because Python's own hash of a text differs from process to process.
        stream = np.random.SeedSequence(
            seed_sequence.entropy,
            spawn_key=(*seed_sequence.spawn_key, crc32(name.encode())),
            pool_size=seed_sequence.pool_size,
        )
        # PCG64 by name: the default generator of NumPy may change, and with it the arm of a seed.
        rng = np.random.Generator(np.random.PCG64(stream))
        draws = distribution.draw(LENGTHS.get(name, 1), rng)
        values[name] = tuple(map(float, draws)) if name in LENGTHS else float(draws[0])
    plant_values = {name: values.pop(name) for name in list(values) if name not in _OF_SPECIMEN}
    return Specimen(**values), MappingProxyType(plant_values)


_OF_SPECIMEN = frozenset(attribute.name for attribute in fields(Specimen))


def _nominal(name: str) -> float:
    """Return the nominal value of a quantity of specimen or plant."""
    if name in _OF_SPECIMEN:
        return 0.0 if name in DEVIATIONS else 1.0
    return float(getattr(Plant, name))


def _check(name: str, value: float) -> None:
    """Raise `TwinError` for a value that a specimen or a plant cannot have."""
    if name not in _OF_SPECIMEN:
        Plant(**{name: value})  # type: ignore[arg-type]
    elif name in LENGTHS:
        Specimen(**{name: (value,) * LENGTHS[name]})  # type: ignore[arg-type]
    else:
        Specimen(**{name: value})  # type: ignore[arg-type]


def _checked_table(key: str, table: object, record: type) -> dict[str, Any]:
    """Return a TOML table whose keys are attributes of a record."""
    available = [attribute.name for attribute in fields(record)]
    if not isinstance(table, Mapping):
        raise TwinError(f"{key} = {table!r} given, expected a table of {', '.join(available)}")
    for name in table:
        if name not in available:
            raise TwinError(f"{key}: unknown key {name!r}, available: {', '.join(available)}")
    return dict(table)

"""How close the truth of an arm comes to each printed model. Run as a module it prints the tables of the docs."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hmtb_twin import JointTruth, Truth, linearize, load_arm
from scenarios.truth.published import PUBLISHED, PublishedModel
from scenarios.truth.published_servos import FREQUENCIES, TARGETS
from sysid import StateSpace


@dataclass(frozen=True)
class PoleMatch:
    """A printed pole and the arm's nearest.

    Attributes:
        printed: The printed pole in the z plane.
        share: Part of the printed gain at 0 Hz that it carries.
        found: The arm's nearest pole in the s plane, rad/s.
        found_share: Part of the arm's gain at 0 Hz that that one carries.
        error: Distance over the printed pole's modulus, both in the s plane.
    """

    printed: complex
    share: float
    found: complex
    found_share: float
    error: float

    @property
    def natural(self) -> complex:
        """The printed pole in the s plane, rad/s."""
        return complex(50.0 * np.log(self.printed))


@dataclass(frozen=True)
class Closeness:
    """A printed model beside the truth about its joint.

    Attributes:
        printed: The printed model.
        truth: The truth.
        poles: Its poles, slowest first; those at z = 0, which are delay, left out.
        response_error: Largest difference of the responses from 0.05 to 5 Hz, each relative to its own gain at 0 Hz.
    """

    printed: PublishedModel
    truth: JointTruth
    poles: tuple[PoleMatch, ...]
    response_error: float


def closeness(truth: Truth) -> tuple[Closeness, ...]:
    """Compare an arm with every printed model.

    Args:
        truth: Its truth.

    Returns:
        One comparison for each printed model.
    """
    return tuple(_closeness(model, truth.joint(model.joint)) for model in PUBLISHED)


def _closeness(printed: PublishedModel, truth: JointTruth) -> Closeness:
    return Closeness(
        printed,
        truth,
        tuple(_matches(printed.model, truth)),
        float(np.abs(_relative(printed.model) - _relative(truth.model)).max()),
    )


def _relative(model: StateSpace) -> np.ndarray:
    return model.frequency_response(FREQUENCIES)[:, 0, 0] / model.dc_gain()[0, 0]


def _matches(model: StateSpace, truth: JointTruth) -> Iterator[PoleMatch]:
    z, shares = _shares(model)
    arm, arm_shares = _shares(truth.model)
    found = truth.natural_poles
    for i in np.argsort(-np.abs(z)):
        if abs(z[i]) > 1e-6:
            natural = np.log(z[i]) / model.dt
            nearest = int(np.argmin(np.abs(found - natural)))
            error = float(abs(found[nearest] / natural - 1.0))
            own = float(arm_shares[np.argmin(np.abs(arm - np.exp(found[nearest] * model.dt)))])
            yield PoleMatch(complex(z[i]), float(shares[i]), complex(found[nearest]), own, error)


def _shares(model: StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles in the z plane, and the part of the gain at 0 Hz that each carries."""
    z, vectors = np.linalg.eig(model.A.astype(complex))
    residues = (model.C @ vectors)[0] * np.linalg.solve(vectors, model.B.astype(complex))[:, 0]
    return z, np.abs(residues / (1.0 - z)) / abs(model.dc_gain()[0, 0])


def tables(truth: Truth) -> str:
    """Write the closeness of an arm to every printed model as two Markdown tables."""
    compared = closeness(truth)
    lines = [
        "| joint | printed model | bandwidth: printed, arm | DC gain: printed, arm | nk: printed, arm | response |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for entry in compared:
        lines.append(
            f"| {_joint(entry)} | {_label(entry)} "
            f"| {entry.printed.bandwidth_hz:.3f}, {entry.truth.bandwidth_hz:.3f} Hz "
            f"| {entry.printed.model.dc_gain()[0, 0]:.2f}, {entry.truth.dc_gain:.2f} "
            f"| {_delay(entry.printed.model)}, {entry.truth.delay_samples} | {entry.response_error:.3f} |"
        )
    lines += [
        "",
        "| joint | printed model | pole, z | pole, rad/s | part of the DC gain "
        "| arm's nearest, rad/s | off by | part of the arm's |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for entry in compared:
        for pole in entry.poles:
            if pole.printed.imag < -1e-9:
                continue
            # A negative real pole is the image of no pole that an arm without delay could have.
            natural, nearest = "none", "none | |"
            if pole.printed.real > 0.0:
                natural = _complex(pole.natural, 2)
                nearest = f"{_complex(pole.found, 2)} | {100 * pole.error:.1f} % | {100 * pole.found_share:.1f} %"
            lines.append(
                f"| {_joint(entry)} | {_label(entry)} | {_complex(pole.printed, 3)} | {natural} "
                f"| {100 * pole.share:.1f} % | {nearest} |"
            )
    return "\n".join(lines) + "\n"


def _joint(entry: Closeness) -> str:
    return entry.printed.joint.replace("_", " ")


def _label(entry: Closeness) -> str:
    return f"**{entry.printed.label}**" if entry.printed in TARGETS else entry.printed.label


def _delay(model: StateSpace) -> int:
    return int(np.flatnonzero(model.markov(5)[:, 0, 0])[0])


def _complex(value: complex, digits: int) -> str:
    if abs(value.imag) < 1e-9:
        return f"{value.real:.{digits}f}"
    return f"{value.real:.{digits}f} ± {abs(value.imag):.{digits}f}j"


if __name__ == "__main__":
    sys.stdout.write(tables(linearize(load_arm("published"))))

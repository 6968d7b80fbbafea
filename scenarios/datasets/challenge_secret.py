"""What nobody may guess: seeds of data sets with hidden truth, and what binds a published folder to them."""

import hmac
import json
import secrets
from dataclasses import replace

from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError

BYTES = 16
"""Of a secret seed and of a salt: nobody tries 2^128 of them."""

SMALLEST = 2**96
"""A secret seed below it, one in four thousand millions, was typed rather than drawn."""


def drawn_secret() -> str:
    """Draw 128 bits from the operating system, hexadecimal."""
    return secrets.token_hex(BYTES)


def secret_spec(spec: DataSetSpec) -> DataSetSpec:
    """The spec with a seed that nobody guesses: its own secret one, else one drawn from the operating system.

    Every waveform that chance makes is drawn anew, because one whose seed is written is no secret.

    Args:
        spec: The spec; a seed that is no secret counts for nothing.

    Raises:
        ScenarioError: A data set whose truth cannot be hidden.
    """
    if spec.commitment or spec.student:
        raise ScenarioError(
            f"{spec.label}: the spec of a published data set given, expected one to build; its key builds it again"
        )
    if spec.twins is None or not any(d.kind != "fixed" for d in spec.twins.distributions.stated.values()):
        raise ScenarioError(
            f"{spec.label}: its arms are those that come with the software, whose truth anyone can compute; expected a "
            "table [twins] with count = 1 or more and distributions such as kp = { kind = 'lognormal', spread = 0.1 }"
        )
    if spec.scoring.steps:
        raise ScenarioError(
            f"{spec.label}: scores {spec.scoring.steps} samples ahead need the outputs that are withheld; expected "
            "[scoring] steps = 0"
        )
    if spec.secret_seed and int(spec.secret_seed, 16) < SMALLEST:
        raise ScenarioError(f"{spec.label}: a secret_seed with many zeros given, expected 128 bits drawn at random")
    records = tuple(replace(block, draw_waveforms=True) for block in spec.records)
    return replace(spec, seed=None, secret_seed=spec.secret_seed or drawn_secret(), records=records)


def student_spec(spec: DataSetSpec, student: str) -> DataSetSpec:
    """The spec of a student's own data set: other twins, noise and waveforms.

    Its seed follows from the secret one and the id by a keyed hash: who knows all ids, and a seed, knows no other.

    Args:
        spec: With a secret seed.
        student: The id.
    """
    digest = hmac.digest(bytes.fromhex(spec.secret_seed), f"hmtb student {student}".encode(), "sha256")
    return replace(spec, student=student, secret_seed=digest[:BYTES].hex())


def commitment(salt: str, spec: DataSetSpec, sums: str) -> str:
    """What a published folder says of what is kept apart: it cannot be changed later, nor guessed from that.

    Args:
        salt: 32 hexadecimal digits, kept apart too: without it a guess cannot be tried.
        spec: With the secret seed.
        sums: SHA-256 of the checksums of all files, the truth and the withheld outputs among them.

    Returns:
        HMAC-SHA-256 under the salt, hexadecimal.
    """
    told = {"label": spec.label, "secret_seed": spec.secret_seed, "sums": sums}
    return hmac.new(bytes.fromhex(salt), json.dumps(told, sort_keys=True).encode(), "sha256").hexdigest()


def public_spec(spec: DataSetSpec, committed: str) -> DataSetSpec:
    """The spec as it is published: a commitment instead of the seed, and no seed of a waveform.

    Args:
        spec: With a secret seed.
        committed: See `commitment`.
    """
    records = tuple(
        replace(
            block,
            excitation=tuple(
                replace(e, parameters={k: v for k, v in e.parameters.items() if k != "seed"}) for e in block.excitation
            ),
            multisines=replace(block.multisines, seed=0) if block.multisines is not None else None,
        )
        for block in spec.records
    )
    return replace(spec, secret_seed="", commitment=committed, records=records)

"""Makes the table of best linear truths: `python -m scenarios.problems.twin_best_linear_table`."""

import json
from pathlib import Path

from scenarios.files.atomic_write import write_whole
from scenarios.problems.twin_best_linear import TABLE, class_key, measured_best_linear
from scenarios.problems.twin_name import twin_name

REALISATIONS = 24
"""Waveforms of each: a fifth of one waveform's scatter is left."""

AMPLITUDES = {"multisine": (5, 10, 40), "prbs": (67,)}
"""Amplitudes by excitation, mrad; binary sequences as the thesis' test 5 has them."""

VARIANTS = ("nominal",)
JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")


def classes() -> tuple[str, ...]:
    """Names of the excitation classes in the table."""
    return tuple(
        f"twin-{variant}-{joint}-{excitation}-{mrad}mrad"
        for variant in VARIANTS
        for joint in JOINTS
        for excitation, amplitudes in AMPLITUDES.items()
        for mrad in amplitudes
    )


def main() -> None:
    """Measure all and write the table beside this file."""
    table = {}
    for text in classes():
        name = twin_name(text)
        found = measured_best_linear(name, realisations=REALISATIONS)
        table[text] = {"key": class_key(name), **found.to_table()}
    lines = ",\n".join(f"{json.dumps(text)}: {json.dumps(entry)}" for text, entry in table.items())
    write_whole(Path(__file__).with_name(TABLE), "{\n" + lines + "\n}\n")


if __name__ == "__main__":
    main()

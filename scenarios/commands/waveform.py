"""`hmtb waveform`: the 100-point file, its plot and its order of excitation."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say

if TYPE_CHECKING:
    from scenarios.waveform import Waveform


def waveform(
    kind: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="KIND")],
    /,
    *,
    amplitude: float | None = None,
    frequency: float | None = None,
    f_start: float | None = None,
    f_end: float | None = None,
    f_min: float | None = None,
    f_max: float | None = None,
    f_low: float | None = None,
    f_high: float | None = None,
    f_center: float | None = None,
    ramp: float | None = None,
    offset: float | None = None,
    clock: int | None = None,
    pulse_width: float | None = None,
    growing: bool = False,
    odd: bool = False,
    seed: int | None = None,
    out: Path = Path("."),
    json: bool = False,
) -> int:
    """Write the 100-point file of an excitation and a plot of it with its spectrum.

    Kinds: sine, two_sines, multisine, prbs, chirp, chirp_as_printed, chirp_franklin, bipolar_ramping_pulse,
    white_noise. Each takes only the options that concern it, by the names they have in scenario files, and says which
    when one is missing. Files of the same names in the folder are replaced.

    Args:
        kind: Name of the excitation.
        amplitude: Largest value, V; 1 V, or 4 V for a bipolar_ramping_pulse, when not given.
        frequency: Frequency of a sine, of the lower of two_sines, or of a bipolar_ramping_pulse, Hz.
        f_start: Start of a chirp or chirp_franklin, Hz.
        f_end: End of a chirp or chirp_franklin, Hz.
        f_min: Lowest line of a multisine, Hz.
        f_max: Highest line of a multisine, Hz.
        f_low: Low frequency of chirp_as_printed, Hz.
        f_high: High frequency of chirp_as_printed, Hz.
        f_center: Centre frequency of chirp_as_printed, Hz.
        ramp: Part of the window over which a chirp_franklin fades in and out.
        offset: Constant that a chirp_franklin adds, V.
        clock: Samples per bit of a prbs.
        pulse_width: Length of each ramp of a bipolar_ramping_pulse, s.
        growing: Let the pulses of a bipolar_ramping_pulse grow over the file.
        odd: Only odd lines in a multisine.
        seed: Seed of prbs, multisine and white_noise.
        out: Folder for KIND.txt (one point per line, V) and KIND.png.
        json: Print JSON.
    """
    wave = _waveform(
        kind,
        {
            "amplitude": amplitude,
            "frequency": frequency,
            "f_start": f_start,
            "f_end": f_end,
            "f_min": f_min,
            "f_max": f_max,
            "f_low": f_low,
            "f_high": f_high,
            "f_center": f_center,
            "ramp": ramp,
            "offset": offset,
            "clock": clock,
            "pulse_width": pulse_width,
            "growing": growing or None,
            "odd": odd or None,
            "seed": seed,
        },
    )
    if not wave.points.any():
        from scenarios.errors import ScenarioError

        raise ScenarioError(f"{kind} of amplitude 0 excites nothing: expected an amplitude other than 0 V")

    import numpy as np

    from scenarios.figures import waveform_figure

    with output_folder(out) as folder:
        text, picture = folder / f"{kind}.txt", folder / f"{kind}.png"
        np.savetxt(text, wave.points, fmt="%.9g")
        waveform_figure(wave).savefig(picture, dpi=150)
    order = wave.order_of_excitation()
    record = {
        "kind": kind,
        "parameters": wave.parameters,
        "points": str(text),
        "plot": str(picture),
        "update_rate_hz": wave.update_rate,
        "period_s": wave.period,
        "order_of_excitation": order,
        "mean_v": float(wave.points.mean()),
        "rms_v": float(np.sqrt(np.mean(wave.points**2))),
    }
    if json:
        print_json(record)
        return 0
    labels = {
        "kind": "excitation",
        "points": "points",
        "plot": "plot",
        "update_rate_hz": "update rate / Hz",
        "period_s": "period / s",
        "order_of_excitation": "order of excitation",
        "mean_v": "mean / V",
        "rms_v": "root mean square / V",
    }
    rows = [
        (label, f"{value:.6g}" if isinstance(value, float) else str(value))
        for label, value in ((label, record[key]) for key, label in labels.items())
    ]
    rows[1:1] = [(f"--{_flag(key)}", str(value)) for key, value in wave.parameters.items()]
    print_table(f"Waveform {kind}", ("", ""), rows)
    if order < 10:
        say(f"Order of excitation {order}: enough for {order} parameters of a linear model, no more.")
    return 0


def _waveform(kind: str, options: Mapping[str, float | int | bool | None]) -> "Waveform":
    """The waveform, with complaints about options in the words that were typed."""
    from inspect import Parameter, signature

    from scenarios.errors import ScenarioError
    from scenarios.excitation import KINDS
    from scenarios.scenario import Excitation
    from scenarios.suggest import unknown

    if kind not in KINDS:
        raise ScenarioError(unknown("excitation", kind, KINDS))
    given = {name: value for name, value in options.items() if value is not None}
    taken = signature(KINDS[kind]).parameters
    takes = ", ".join(f"--{_flag(name)}" for name in taken)
    for name in given:
        if name not in taken:
            raise ScenarioError(f"{kind} has no --{_flag(name)}; it takes {takes}")
    missing = [name for name, entry in taken.items() if entry.default is Parameter.empty and name not in given]
    if missing:
        raise ScenarioError(f"{kind} needs {' and '.join(f'--{_flag(name)}' for name in missing)}; it takes {takes}")
    return Excitation(kind, given).waveform()


def _flag(name: str) -> str:
    return name.replace("_", "-")

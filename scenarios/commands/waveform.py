"""`hmtb waveform`: the 100-point file, its plot and its order of excitation."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, print_table, say, writable_folder


def waveform(
    kind: Annotated[str, tyro.conf.Positional],
    /,
    *,
    amplitude: float = 1.0,
    frequency: float | None = None,
    f_start: float | None = None,
    f_end: float | None = None,
    clock: int | None = None,
    pulse_width: float | None = None,
    seed: int | None = None,
    out: Path = Path("."),
    json: bool = False,
) -> int:
    """Write the 100-point file of an excitation and a plot of it with its spectrum.

    Kinds: sine, two_sines, multisine, prbs, chirp, chirp_as_printed, chirp_franklin, bipolar_ramping_pulse,
    white_noise. Each takes only the options that concern it, and says which when one is missing.

    Args:
        kind: Name of the excitation.
        amplitude: Largest value, V.
        frequency: Frequency of sine, pulse or lower tone, Hz.
        f_start: Start of a sweep (lowest line of a multisine), Hz.
        f_end: End of a sweep (highest line of a multisine), Hz.
        clock: Samples per bit of a PRBS.
        pulse_width: Length of each ramp of the bipolar ramping pulse, s.
        seed: Seed of PRBS, multisine and noise.
        out: Folder for KIND.txt (one point per line, V) and KIND.png.
        json: Print JSON.
    """
    from scenarios.scenario import Excitation

    names = {"f_start": f_start, "f_end": f_end}
    if kind == "multisine":
        names = {"f_min": f_start, "f_max": f_end}
    elif kind == "chirp_as_printed":
        names = {"f_low": f_start, "f_high": f_end, "f_center": frequency}
    given = {"amplitude": amplitude, "clock": clock, "pulse_width": pulse_width, "seed": seed, **names}
    if kind != "chirp_as_printed":
        given["frequency"] = frequency
    wave = Excitation(kind, {key: value for key, value in given.items() if value is not None}).waveform()

    import numpy as np

    from scenarios.figures import waveform_figure

    folder = writable_folder(out)
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
    rows = [
        (key.replace("_", " "), f"{value:.6g}" if isinstance(value, float) else str(value))
        for key, value in record.items()
        if key != "parameters"
    ]
    rows[1:1] = [(key.replace("_", " "), str(value)) for key, value in wave.parameters.items()]
    print_table(f"Waveform {kind}", ("", ""), rows)
    if order < 10:
        say(f"Order of excitation {order}: enough for {order} parameters of a linear model, no more.")
    return 0

"""`hmtb waveform`: the 100-point file, its plot and its order of excitation."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say_each, say_next
from scenarios.files.errors import ScenarioError, unknown

if TYPE_CHECKING:
    from scenarios.experiments.excitation_computer import Excitation

NOT_OPTIONS = ("kind", "path", "repeat_frequency", "out", "overwrite", "json")
"""Parameters of the command that no excitation takes."""


def waveform(
    kind: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="KIND")],
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
    register: int | None = None,
    pulse_width: float | None = None,
    growing: bool = False,
    odd: bool = False,
    memory: float | None = None,
    as_printed: bool = False,
    seed: int | None = None,
    repeat_frequency: float | None = None,
    path: Path | None = None,
    out: Path = Path("."),
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Write the 100-point file of an excitation, and plot its spectrum.

    Kinds: sine, two_sines, multisine, prbs, sign_recursion, chirp, chirp_as_printed, chirp_franklin,
    bipolar_ramping_pulse, white_noise; and file, a 100-point file of your own, which is only shown. Each kind has
    options of its own, named as in scenario files; errors list them.

    Args:
        kind: Name of the excitation.
        amplitude: Largest value, V, half of it for a sign_recursion with --as-printed; 1 V, or 4 V for a
            bipolar_ramping_pulse, when not given.
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
        clock: Samples per bit of a prbs, a maximum-length sequence cut to 100 points: its mean may be up to 0.16 of
            the amplitude at 2, the default, 0.28 at 3, as a rule more at longer bits.
        register: Bits of the register behind a prbs; the shortest that fills the file when not given.
        pulse_width: Length of each ramp of a bipolar_ramping_pulse, s.
        growing: Let the pulses of a bipolar_ramping_pulse grow over the file.
        odd: Only odd lines in a multisine.
        memory: Weight of the last level in a sign_recursion, against noise of standard deviation 1.
        as_printed: Give a sign_recursion levels of twice the amplitude, as equation (2.11) is printed, without its
            factors 1/2.
        seed: Seed of prbs, sign_recursion, multisine and white_noise.
        repeat_frequency: How often the file is played per second, Hz, which scales every frequency in it; 0.5 Hz, or
            0.25 Hz for two_sines with a lower tone that needs 4 s, when not given.
        path: The file, with kind file: 100 numbers in V.
        out: Folder for KIND.txt (one point per line, V) and KIND.png.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    options = locals()  # before any other local variable: all options, most of them of one kind or another
    from scenarios.experiments.excitation_review import (
        check_excites,
        excitation_rows,
        excitation_summary,
        excitation_warnings,
    )
    from scenarios.experiments.model_structures import needed_orders
    from scenarios.experiments.preview_figure import waveform_figure
    from scenarios.experiments.registry import tags
    from scenarios.experiments.waveform import write_points
    from scenarios.report.figures import save_figure

    stated = {}
    for name, value in options.items():
        is_stated = value is not None and value is not False
        if is_stated and name not in NOT_OPTIONS:
            stated[name] = value
    excitation = _excitation(kind, stated, path, repeat_frequency)
    # Before files are written: without power nothing is identified.
    check_excites(excitation)
    wave = excitation.waveform()
    name = kind if path is None else path.stem
    files = (f"{name}.png",) if path else (f"{name}.txt", f"{name}.png")
    with output_folder(out, *files, overwrite=overwrite) as folder:
        file = write_points(wave.points.tolist(), folder / f"{name}.txt") if path is None else path
        picture = folder / f"{name}.png"
        save_figure(waveform_figure(wave), picture, dpi=150)
    parameters = wave.parameters if path is None else {"path": str(path)}
    warnings = excitation_warnings(excitation)
    if json:
        print_json(
            {
                "kind": kind,
                "parameters": parameters,
                "points": file,
                "plot": picture,
                **excitation_summary(excitation),
                "needed_order": needed_orders(),
                "warnings": warnings,
            }
        )
        return 0
    rows = [("excitation", kind)]
    rows += [(f"--{_flag(key)}", str(value)) for key, value in parameters.items()]
    rows += [("points", str(file)), ("plot", str(picture)), *excitation_rows(excitation)]
    print_table(f"Waveform {kind}", ("", ""), rows)
    say_each("warning: ", warnings)
    tag = ("--tag", kind) if kind in tags() else ()
    say_next("scenarios", "list", *tag)
    return 0


def _excitation(
    kind: str, options: Mapping[str, float | int | bool], path: Path | None, repeat_frequency: float | None
) -> "Excitation":
    """Build the excitation from options of the command; errors name them as they were typed."""
    from inspect import Parameter, signature

    from scenarios.experiments.excitation import COMPUTED
    from scenarios.experiments.excitation_computer import FILE, Excitation
    from scenarios.experiments.waveform import read_points

    if kind in (FILE, "points"):
        if kind != FILE or path is None or options:
            raise ScenarioError(
                f"custom points come from a file: hmtb waveform {FILE} --path FILE, and --repeat-frequency at most"
            )
        return Excitation("points", {"points": read_points(path)}, repeat_frequency)
    if kind not in COMPUTED:
        raise ScenarioError(unknown("excitation", kind, [FILE, *COMPUTED]))
    if path is not None:
        raise ScenarioError(f"{kind} has no --path; a custom file is shown by: hmtb waveform {FILE} --path FILE")
    parameters = signature(COMPUTED[kind]).parameters
    takes = ", ".join(f"--{_flag(name)}" for name in parameters)
    for name in options:
        if name not in parameters:
            raise ScenarioError(f"{kind} has no --{_flag(name)}; it takes {takes}")
    missing = []
    for name, parameter in parameters.items():
        if parameter.default is Parameter.empty and name not in options:
            missing.append(f"--{_flag(name)}")
    if missing:
        raise ScenarioError(f"{kind} needs {' and '.join(missing)}; it takes {takes}")
    return Excitation(kind, options, repeat_frequency)


def _flag(name: str) -> str:
    return name.replace("_", "-")

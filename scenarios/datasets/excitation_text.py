"""What is played in a block of records and under which conditions, in words."""

from collections.abc import Iterator
from dataclasses import fields

from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.datasets.spec_tables import PAYLOAD, RecordBlock
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines
from scenarios.experiments.waveform import POINTS, Parameter

KINDS = {"prbs": "pseudorandom binary sequence", "points": "points of a file"}
"""Names of excitations that their kind does not tell."""

MODES = {
    "single_joint": "the stick commands {joints}",
    "single_joint_rate": "the stick commands velocities of {joints}",
    "cartesian": "the stick commands where the tool is",
    "cartesian_rate": "the stick commands velocities of the tool",
}
"""Control modes."""


def played(block: RecordBlock) -> str:
    """What the records of a block are excited by.

    Args:
        block: The block.
    """
    if block.multisines is not None:
        told = _multisines(block, block.multisines)
    elif block.scenarios:
        told = f"scenarios, as `hmtb scenarios show NAME` prints each: {', '.join(block.scenarios)}"
    else:
        told = _excitations(block)
    if block.amplitudes:
        unit = "rad root mean square" if block.multisines is not None else "V"
        told += f"; at {', '.join(f'{value:g}' for value in block.amplitudes)} {unit}"
    if not block.draw_waveforms:
        return told
    return f"{told}; drawn anew for each {'experiment' if block.multisines is None else 'measurement'}"


def conditions(block: RecordBlock) -> str:
    """Arms, payloads, poses, drives and control mode of a block.

    Args:
        block: The block.
    """
    own = bool(block.scenarios)
    varied = {
        "variant": block.variants,
        "payload": ("that of the scenario",) if own and block.payloads == (PAYLOAD,) else block.payloads,
        "pose": ("that of the scenario",) if own and block.poses == (OPERATING_POSE,) else block.poses,
        "actuators": block.actuators,
        "friction": block.frictions,
    }
    told = [f"{key} {', '.join(values)}" for key, values in varied.items()]
    if any(block.process_noises):
        told.append(f"process noise {', '.join(f'{value:g}' for value in block.process_noises)} of the rated torque")
    together = len(block.axes) > 1 and not block.each_axis
    joints = "several joints at once, an axis of the stick for each" if together else "one joint"
    told.append("mode of the scenario" if own else MODES[block.mode].format(joints=joints))
    off = [] if own else [entry.name for entry in fields(block.chain) if not getattr(block.chain, entry.name)]
    return "; ".join([*told, *(f"without {name.replace('_', ' ')}" for name in off)])


def _multisines(block: RecordBlock, one: Multisines) -> str:
    records = len(block.axes) if not block.each_axis else 1
    rms = "" if block.amplitudes else f" of {one.rms:g} rad root mean square"
    times = f" x {records} records, with phases that are orthogonal over these," if records > 1 else ""
    return (
        f"random-phase multisines{rms}, {one.f_min:g} to {one.f_max:g} Hz, "
        f"{'odd lines of a grid' if one.odd else 'lines'} {1.0 / one.period:.4g} Hz apart; {one.realisations} "
        f"realisations{times} of {one.settling} + {one.periods} periods of {one.period:g} s, the first "
        f"{'one' if one.settling == 1 else one.settling} to settle"
    )


def _excitations(block: RecordBlock) -> str:
    texts = [excitation(one, drawn=block.draw_waveforms, amplitude=not block.amplitudes) for one in block.excitation]
    if len(texts) == 1:
        shared = len(block.axes) > 1 and not block.each_axis
        return f"one waveform that all axes share: {texts[0]}" if shared else texts[0]
    if len(set(texts)) == 1:
        return f"a waveform of its own on each axis: {texts[0]}"
    return "; ".join(f"{axis}: {text}" for axis, text in zip(block.axes, texts, strict=True))


def excitation(one: Excitation, *, drawn: bool, amplitude: bool = True) -> str:
    """An excitation in words, with frequencies and times as it is played.

    Args:
        one: The excitation.
        drawn: Whether every experiment draws its own: then the seed that is written is that of none.
        amplitude: Whether its amplitude is the one that is played.
    """
    wave = one.waveform()
    unscaled = Excitation(one.kind, one.parameters).waveform()
    faster = wave.update_rate / unscaled.update_rate
    skipped = {"seed"} if drawn else set()
    skipped |= set() if amplitude else {"amplitude"}
    told = [
        text
        for key, value in wave.parameters.items()
        if key not in skipped
        for text in _parameter(key, value, faster, wave.update_rate)
    ]
    told.append(f"{POINTS} points, repeated every {POINTS / wave.update_rate:.4g} s")
    if one.iterations is not None:
        told.append(f"{one.iterations} times, then nothing")
    return f"{KINDS.get(one.kind, one.kind.replace('_', ' '))} ({', '.join(told)})"


def _parameter(key: str, value: Parameter, faster: float, rate: float) -> Iterator[str]:
    """A parameter with its unit; what says nothing is left out."""
    name = key.replace("_", " ")
    match key, value:
        case _, tuple():
            return
        case _, bool():
            if value:
                yield name
        case "amplitude", _:
            yield f"amplitude {value:g} V"
        case "clock", _:
            yield f"a level for {value / rate:.4g} s"
        case "register", _:
            if value:
                yield f"register of {value} bits"
        case "pulse_width", _:
            yield f"{name} {value / faster:.4g} s"
        case _ if key == "frequency" or key.startswith("f_"):
            yield f"{name.replace('f ', 'f_')} {value * faster:.4g} Hz"
        case _:
            yield f"{name} {value:g}"

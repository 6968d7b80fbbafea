"""`hmtb truth`: what an estimator should have found."""

from scenarios.commands.output import print_json, print_table, say

LOCKED = 1e-2
"""Gain at 0 Hz below which a joint does not follow its command."""

LOCKED_NOTE = "locked: the joint is indexed and does not follow a command, so it has no bandwidth"


def truth(*, variant: str = "nominal", payload: str = "rpcm", json: bool = False) -> int:
    """Poles, zeros, bandwidth, gain and delay of each joint of the linearised arm, sampled at 50 Hz.

    A joint that does not follow its command is locked: it has no bandwidth.

    Args:
        variant: Which arm: nominal.
        payload: What the end effector holds: rpcm (the module) or none.
        json: Print JSON.
    """
    import numpy as np

    from hmtb_twin import JOINTS, linearize, load_arm

    record = linearize(load_arm(variant, payload))
    joints = {name: record.joint(name) for name in JOINTS}
    locked = {name for name, entry in joints.items() if abs(entry.dc_gain) < LOCKED}
    if json:
        print_json(
            {
                "dt": record.dt,
                "variant": variant,
                "payload": payload,
                "joints": {
                    name: {
                        "bandwidth_hz": None if name in locked else entry.bandwidth_hz,
                        "dc_gain": entry.dc_gain,
                        "poles": np.asarray(entry.poles, dtype=complex),
                        "zeros": np.asarray(entry.zeros, dtype=complex),
                        "delay_samples": entry.delay_samples,
                        "note": LOCKED_NOTE if name in locked else None,
                    }
                    for name, entry in joints.items()
                },
                "small_signal_error": record.small_signal_error,
            }
        )
        return 0
    rows = [
        (name, "locked", "—", "—", "—", "—")
        if name in locked
        else (
            name,
            f"{entry.bandwidth_hz:.3f}",
            f"{entry.dc_gain:.4f}",
            str(entry.delay_samples),
            ", ".join(_text(pole, record.dt) for pole in _dominant(np.asarray(entry.poles))),
            _zeros(np.asarray(entry.zeros, dtype=complex)),
        )
        for name, entry in joints.items()
    ]
    columns = (
        "joint",
        "bandwidth / Hz",
        "gain at 0 Hz",
        "delay / samples",
        "slowest poles / (rad/s)",
        "zeros (z plane), largest",
    )
    print_table(f"Linearised truth of the arm '{variant}' with payload '{payload}'", columns, rows)
    for name in sorted(locked):
        say(f"{name}: {LOCKED_NOTE}")
    errors = ", ".join(f"{error:.1e} at {amplitude:g} rad" for amplitude, error in record.small_signal_error.items())
    say(f"Relative error of the linear model against the simulated arm (friction off): {errors}")
    say("All poles and zeros in the z plane: --json")
    return 0


def _zeros(zeros: "np.ndarray", count: int = 3) -> str:  # type: ignore[name-defined]  # noqa: F821
    upper = sorted((zero for zero in zeros if zero.imag > -1e-9), key=abs, reverse=True)
    shown = [f"{zero.real:.2f}" + (f"±{zero.imag:.2f}j" if zero.imag > 1e-6 else "") for zero in upper[:count]]
    return ", ".join(shown) + (", ..." if len(upper) > count else "") or "none"


def _dominant(poles: "np.ndarray", count: int = 3) -> "np.ndarray":  # type: ignore[name-defined]  # noqa: F821
    return poles[abs(poles).argsort()[::-1]][:count]


def _text(pole: complex, dt: float) -> str:
    import numpy as np

    s = np.log(complex(pole)) / dt if abs(pole) > 1e-9 else complex(-np.inf)
    return f"{s.real:.1f}" if abs(s.imag) < 1e-6 else f"{s.real:.1f}{s.imag:+.1f}j"

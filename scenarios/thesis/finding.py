"""Claims of the thesis and the findings that test them [Morris1996]."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal


@dataclass(frozen=True)
class ThesisClaim:
    """A claim of the thesis.

    Attributes:
        key: F1 to F26.
        text: What it says.
        where: Where it says so.
        thesis: Its number or word for it.
    """

    key: str
    text: str
    where: str
    thesis: str


CLAIMS: Mapping[str, ThesisClaim] = MappingProxyType(
    {
        entry.key: entry
        for entry in (
            ThesisClaim(
                "F1",
                "gain below one over the band, low-frequency cutoff near 6 rad/s (yaw) and 7 rad/s (pitches)",
                "III.2A, III.3",
                "6 (yaw), 7 and 7 (pitches)",
            ),
            ThesisClaim(
                "F2",
                "second-order slope from the break to about 10 rad/s, resonances and disturbances above",
                "III.2A",
                "second order, -40 dB per decade far above the break",
            ),
            ThesisClaim(
                "F3",
                "two to five samples of delay from input to output of both pitches",
                "III.3",
                "2 to 5 (pitches)",
            ),
            ThesisClaim(
                "F4",
                "the PRBS input looks white with periodic side peaks",
                "III.2B",
                "white, with small periodic peaks",
            ),
            ThesisClaim(
                "F5",
                "with the bipolar ramping pulse the disturbance spectrum concentrates around and below 1 Hz, the "
                "output's and the input's in 1-5 Hz",
                "III.2C",
                "predominantly around 1 Hz",
            ),
            ThesisClaim(
                "F6",
                "with two sines at 2.5 and 10 Hz the disturbance lies two orders (yaw) and one order (pitches) below "
                "the output",
                "III.2C, III.3",
                "2 (yaw), 1 (pitches)",
            ),
            ThesisClaim(
                "F7",
                "measurement disturbances exceed process disturbances",
                "III.4",
                "above one, judged from spectra",
            ),
            ThesisClaim(
                "F8",
                "ARX and IV4 give inconsistent models from one data set to the next, ARMAX and OE do not",
                "IV.1",
                "inconsistent; consistent",
            ),
            ThesisClaim(
                "F9",
                "yaw: ARMAX with 5 poles, 2 zeros, 2 delays has white, independent residuals and a near pole-zero "
                "cancellation",
                "IV.3A",
                "white, independent, one near cancellation",
            ),
            ThesisClaim(
                "F10",
                "yaw: the residuals of OE (2 poles, 1 zero, 2 delays) are not white; OE with more poles turns unstable",
                "IV.3A",
                "not white; unstable",
            ),
            ThesisClaim(
                "F11",
                "shoulder pitch: OE (2 poles, 1 zero, 1 delay) is best, its residuals independent of the input",
                "IV.4",
                "OE best, independent",
            ),
            ThesisClaim(
                "F12",
                "elbow pitch: ARMAX (2 poles, 1 zero, 2 delays) is best, whiter than OE",
                "IV.4",
                "ARMAX best, whiter",
            ),
            ThesisClaim("F13", "all models are stable", "IV, V, VI.3", "below one"),
            ThesisClaim(
                "F14",
                "OKID from PRBS with p = 5: order 2 describes 99.87 % (yaw), 96.11 % (shoulder), 98.88 % (elbow) of "
                "the data",
                "V.2, V.3",
                "99.87, 96.11, 98.88",
            ),
            ThesisClaim(
                "F15",
                "without detrending, OKID needs order 4 for yaw, with extremely poor residuals but fewer observer "
                "parameters",
                "V.2",
                "4; extremely poor; fewer",
            ),
            ThesisClaim(
                "F16",
                "OKID poles are all real and its transmission zeros complex pairs; the SysID model has complex poles",
                "VI.3",
                "0; all; some",
            ),
            ThesisClaim("F17", "the Bode plots of the SysID and the OKID model agree", "VI.2", "comparable"),
            ThesisClaim(
                "F18",
                "RPCM data: OKID fits better than SysID on every joint, SysID is worst on shoulder pitch",
                "VI.4",
                "OKID better on 3 of 3; SysID worst on shoulder pitch",
            ),
            ThesisClaim(
                "F19",
                "RPCM residuals: SysID white on yaw and elbow but not shoulder; OKID fairly white on yaw and shoulder, "
                "less on elbow; yaw residuals correlate with the input at lags below 15",
                "VI.4",
                "yaw, elbow; yaw, shoulder; below 15",
            ),
            ThesisClaim(
                "F20",
                "5-10 Hz multi-input chirp: OKID fits better, slight coupling from the pitch inputs into the yaw "
                "residuals",
                "VI.5",
                "OKID better; slight",
            ),
            ThesisClaim(
                "F21",
                "low-frequency data: SysID beats OKID on yaw, so a hybrid model is best there",
                "VI.6",
                "SysID better on yaw; hybrid best",
            ),
            ThesisClaim(
                "F22",
                "cutoff about 1 Hz per joint, yet the models follow data with 3-5 Hz content",
                "VI.6",
                "follow",
            ),
            ThesisClaim("F23", "above 5 Hz OKID is slightly better on every joint", "VI.6", "slightly better"),
            ThesisClaim("F24", "parsimony: orders 2/2/2 (OKID) against 5/2/3 (SysID)", "VI.6", "2/2/2 suffice"),
            ThesisClaim("F25", "SysID is robust to bias and outliers, OKID is sensitive", "VI.6", "robust; sensitive"),
            ThesisClaim("F26", "little coupling between the joints near the operating point", "VI.6", "little"),
        )
    }
)
"""Every claim, in order."""


Verdict = Literal["reproduced", "partly", "not reproduced", "cannot be told"]


@dataclass(frozen=True)
class Finding:
    """A finding with its verdict and the number it rests on.

    Attributes:
        key: F1 to F26.
        claim: What the thesis says.
        where: Where it says so.
        verdict: Whether the twin shows the same.
        value: The number, or several by name (joints, as a rule); nothing where it cannot be told. One named `of`, or
            `of ...`, is the whole of which the number before it counts a part.
        unit: Its unit and meaning in a few words.
        thesis: The thesis' number or word.
        why: One sentence: what the verdict rests on and the most likely reason.
    """

    key: str
    claim: str
    where: str
    verdict: Verdict
    value: float | Mapping[str, float]
    unit: str
    thesis: str
    why: str


def decided_finding(key: str, verdict: Verdict, value: float | Mapping[str, float], unit: str, why: str) -> Finding:
    """Build a finding on the claim with this key.

    Args:
        key: F1 to F26.
        verdict: Whether the twin shows the same.
        value: The number, or several by name.
        unit: Its unit and meaning.
        why: What the verdict rests on.

    Returns:
        The finding.
    """
    claim = CLAIMS[key]
    return Finding(key, claim.text, claim.where, verdict, value, unit, claim.thesis, why)


def undecided_finding(key: str, why: str) -> Finding:
    """Return a finding that cannot be decided, and the reason."""
    return decided_finding(key, "cannot be told", {}, "", why)


def verdict(passed: int, total: int) -> Verdict:
    """Verdict from the number of parts that hold: all, some or none."""
    if passed == total:
        return "reproduced"
    return "partly" if passed else "not reproduced"

"""Counterparts in the report of each figure of the thesis [Morris1996, list of figures]."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scenarios.report.figures import Picture


@dataclass(frozen=True)
class FigureKind:
    """Figures of the thesis that show the same thing, of one joint each or of the whole.

    Attributes:
        chapter: Where they stand.
        shows: What they show, in our words.
        numbers: Their numbers: shoulder yaw, shoulder pitch, elbow pitch where there is one of each.
        instead: What stands for them where the report has no figure of the kind, or why there is none.
    """

    chapter: str
    shows: str
    numbers: tuple[str, ...]
    instead: str = ""


def _same(chapter: str, shows: str, *numbers: str) -> FigureKind:
    return FigureKind(chapter, shows, numbers)


KINDS: tuple[FigureKind, ...] = (
    FigureKind("I", "space station, its manipulators and the flight servicer", ("1", "2", "3"), "pictures of hardware"),
    FigureKind(
        "I", "the test bed, its set-up and its arm", ("4", "5", "6"), "the rendered arm at the top of “The laboratory”"
    ),
    FigureKind(
        "I",
        "the control station, outside and inside",
        ("7", "8"),
        "no picture; its hand controller and camera views exist in the laboratory",
    ),
    FigureKind("I", "the replacement unit", ("9",), "the strip of the exchange in “The laboratory”"),
    FigureKind("II", "the course of an experiment", ("10",), "the text of “The laboratory”"),
    _same("II", "white noise, one period", "11"),
    _same("II", "sum of two sines, one period", "12"),
    _same("II", "its power spectrum", "13"),
    _same("II", "pseudorandom binary sequence and its spectrum", "14"),
    _same("II", "chirp and its spectrum", "15"),
    _same("II", "bipolar ramping pulse and its spectrum", "16"),
    FigureKind("II", "screen of the waveform program", ("17",), "the command hmtb waveform, hmtb preview"),
    FigureKind(
        "II", "wiring of one and of several axes", ("18", "19"), "the interface is simulated; text of “The laboratory”"
    ),
    _same("III", "two sines up to 10 Hz: whole record", "20", "A1", "A16"),
    _same("III", "the same, magnified", "21"),
    _same("III", "transfer function estimate", "22", "A2", "A17"),
    _same("III", "PRBS: whole record", "23", "A3", "A18"),
    _same("III", "the same, magnified", "24"),
    _same("III", "correlations of output and input", "25", "A4", "A19"),
    _same("III", "bipolar ramping pulse: whole record", "26", "A5", "A20"),
    _same("III", "the same, magnified", "A6"),
    _same("III", "pulse: disturbance spectrum", "27", "A7", "A21"),
    _same("III", "pulse: output spectrum", "28", "A8", "A22"),
    _same("III", "pulse: input spectrum", "29", "A9", "A23"),
    _same("III", "pulse: cross spectrum", "30", "A10", "A24"),
    _same("III", "two sines, record of the spectra", "31", "A25"),
    _same("III", "the same, magnified", "32", "A11"),
    _same("III", "two sines: disturbance spectrum", "33", "A12", "A26"),
    _same("III", "two sines: output spectrum", "34", "A13", "A27"),
    _same("III", "two sines: input spectrum", "35", "A14", "A28"),
    _same("III", "two sines: cross spectrum", "36", "A15", "A29"),
    FigureKind(
        "IV", "the course of an identification, screen of its program", ("37", "38"), "the command hmtb identify"
    ),
    _same("IV", "ARMAX: residuals", "39", "A30", "A41"),
    _same("IV", "ARMAX: whiteness and independence", "40", "A31", "A42"),
    _same("IV", "ARMAX: poles and zeros", "41", "A32", "A43"),
    _same("IV", "ARMAX: output on the data of estimation", "42", "A33", "A44"),
    _same("IV", "ARMAX: output on other data", "43", "A34", "A45"),
    _same("IV", "output error: residuals", "44", "A35", "A46"),
    _same("IV", "output error: whiteness and independence", "45", "A36", "A47"),
    _same("IV", "output error: poles and zeros", "46", "A37", "A48"),
    _same("IV", "output error: output on the data of estimation", "47", "A38", "A49"),
    _same("IV", "output error: output on other data", "48", "A39", "A50"),
    _same("IV", "Bode plots of ARMAX, ARX and output error", "49", "A40", "A51"),
    _same("V", "OKID: system and observer Markov parameters", "50", "A52", "A58"),
    _same("V", "OKID: prediction errors", "51", "A53", "A59"),
    _same("V", "OKID: Hankel singular values", "52", "A54", "A60"),
    _same("V", "OKID: Bode plot of the realization", "53", "A55", "A61"),
    _same("V", "OKID: predicted and measured output", "54", "A56", "A62"),
    _same("V", "OKID: output on the chirp", "55", "A57", "A63"),
    _same("VI", "block diagrams of ARMAX and output error", "56", "57"),
    _same("VI", "SysID model: Bode plots", "58", "59", "60"),
    _same("VI", "OKID model: Bode plots", "61", "62", "63"),
    _same("VI", "SysID model: poles and transmission zeros", "64"),
    _same("VI", "OKID model: poles and transmission zeros", "65"),
    _same("VI", "exchange: record of three joints", "66"),
    _same("VI", "exchange: output of the SysID model", "67", "68", "69"),
    _same("VI", "exchange: residuals of the SysID model", "70"),
    _same("VI", "exchange, SysID: whiteness and independence", "71", "72"),
    _same("VI", "exchange: output of the OKID model", "73", "74", "75"),
    _same("VI", "exchange: residuals of the OKID model", "76"),
    _same("VI", "exchange, OKID: whiteness and independence", "77", "78"),
    _same("VI", "chirp of 5 to 10 Hz: record of three joints", "79"),
    _same("VI", "chirp: output of the SysID model", "80", "81", "82"),
    _same("VI", "chirp: residuals of the SysID model", "83"),
    _same("VI", "chirp: output of the OKID model", "84", "85", "86"),
    _same("VI", "chirp: residuals of the OKID model", "87"),
    FigureKind(
        "VII",
        "model reference control of the ground arm",
        ("88",),
        "outside this study; the flight arm that it would follow is in the laboratory",
    ),
)
"""Every figure of the thesis, in kinds."""


@dataclass(frozen=True)
class MappedKind:
    """A kind of thesis figure with its counterparts in the report.

    Attributes:
        kind: The kind.
        pictures: By figure of the thesis, ours, in the order of the page.
    """

    kind: FigureKind
    pictures: Mapping[str, tuple[Picture, ...]]

    @property
    def missing(self) -> tuple[str, ...]:
        """Thesis figures whose expected counterpart is missing."""
        return () if self.kind.instead else tuple(number for number, ours in self.pictures.items() if not ours)


def map_figures(counterparts: Mapping[str, Sequence[Picture]]) -> tuple[MappedKind, ...]:
    """Match the figures of the report with those of the thesis.

    Args:
        counterparts: Pictures by figure of the thesis, see `Gallery.counterparts`.

    Returns:
        Every kind of figure of the thesis, in its order.

    Raises:
        ValueError: A picture names a figure that the thesis does not have.
    """
    known = {number for kind in KINDS for number in kind.numbers}
    unknown = sorted(set(counterparts) - known)
    if unknown:
        raise ValueError(f"figures {', '.join(unknown)} of the thesis: expected 1 to 88 and A1 to A63")
    return tuple(
        MappedKind(kind, {number: tuple(counterparts.get(number, ())) for number in kind.numbers}) for kind in KINDS
    )

"""What goes wrong on a bus: messages the recorder misses, terminals that do not answer, words that fail parity."""

from dataclasses import dataclass, fields

import numpy as np

from hmtb_twin.bus.messages import FRAME, INTRA_PACKET_HEADER, layout
from hmtb_twin.bus.words import MESSAGES
from hmtb_twin.parameters.errors import TwinError

MESSAGE_ERROR, FORMAT_ERROR, NO_RESPONSE = 1 << 12, 1 << 10, 1 << 9
WORD_COUNT_ERROR, SYNC_ERROR, INVALID_WORD = 1 << 5, 1 << 4, 1 << 3
"""Bits of the block status word [IRIG2015, 10.6.4]."""

BUS_B = 1 << 13
"""The bit that says on which of the two buses a message passed; no fault."""

FAULTS = {
    INVALID_WORD: "invalid word",
    NO_RESPONSE: "no response",
    WORD_COUNT_ERROR: "wrong word count",
    FORMAT_ERROR: "format error",
    SYNC_ERROR: "wrong sync",
    MESSAGE_ERROR: "message error",
}
"""What to call a flagged message: by the first of these bits that it has."""


@dataclass(frozen=True)
class BusFaults:
    """How often each fault occurs, independently of the others.

    Attributes:
        dropped: Probability that the recorder misses a message altogether.
        silent: Probability that a terminal does not answer a message.
        invalid: Probability that a data word fails parity. A terminal that receives one does not answer.
        short: Probability that the last data word of a message is missing. A terminal that receives too few does not
            answer.
        seed: Seed of the draws.
    """

    dropped: float = 0.0
    silent: float = 0.0
    invalid: float = 0.0
    short: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name != "seed" and not 0.0 <= value <= 1.0:
                raise TwinError(f"{entry.name}: a probability of {value} given, expected 0 to 1")

    def strike(self, frames: np.ndarray, sent: np.ndarray, test: int) -> tuple[np.ndarray, np.ndarray]:
        """Let the faults act.

        Args:
            frames: The ticks (N,) as `FRAME`, left as they are.
            sent: Which messages there are (N, 3).
            test: Number of the test; each has draws of its own.

        Returns:
            The ticks with their faults flagged, and which of their bytes the recorder holds (N, bytes of a tick).
        """
        rng = np.random.default_rng([self.seed, test])
        frames = frames.copy()
        kept = np.ones((len(frames), FRAME.itemsize), bool)
        start = 0
        for column, message in enumerate(MESSAGES):
            part, size = frames[message.name], layout(message).itemsize
            dropped, silent, short = (
                rng.random(len(frames)) < rate for rate in (self.dropped, self.silent, self.short)
            )
            wrong = rng.random(part["data"].shape) < self.invalid
            part["data"] ^= np.where(wrong, 1 << rng.integers(16, size=wrong.shape), 0).astype(np.uint16)
            # A terminal that does not answer sends no data in which anything could be wrong.
            heard = ~silent if message.transmits else np.ones(len(frames), bool)
            invalid, short = wrong.any(axis=1) & heard, short & heard
            unanswered = silent if message.transmits else silent | invalid | short
            part["block_status"] |= (
                np.where(invalid | short | unanswered, MESSAGE_ERROR, 0)
                | np.where(invalid, INVALID_WORD, 0)
                | np.where(short, WORD_COUNT_ERROR, 0)
                | np.where(unanswered, NO_RESPONSE, 0)
            ).astype(np.uint16)
            held = kept[:, start : start + size]
            data_end = size if message.transmits else size - 2
            held[short, data_end - 2 : data_end] = False
            held[unanswered, INTRA_PACKET_HEADER + 2 if message.transmits else size - 2 :] = False
            part["length"] = held.sum(axis=1) - INTRA_PACKET_HEADER
            held[dropped | ~sent[:, column]] = False
            start += size
        return frames, kept

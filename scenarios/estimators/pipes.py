"""The pipes between the bench and the process of an estimator."""

import os
from dataclasses import dataclass, field

READ = 1 << 18


@dataclass
class Pipes:
    """Three pipes, seen from the bench, whose ends never wait; and the other ends until the process has them.

    Attributes:
        request: Where requests are written; -1 where there is none.
        reply: Where replies come; -1 where there is none.
        printed: Where what is printed comes.
        theirs: The other ends, in that sequence, -1 where there is none.
        ours: Ends to be closed.
    """

    request: int = -1
    reply: int = -1
    printed: int = -1
    theirs: tuple[int, int, int] = (-1, -1, -1)
    ours: list[int] = field(default_factory=list)

    @classmethod
    def open(cls, *, channel: bool) -> "Pipes":
        """New ones.

        Args:
            channel: Whether there are requests and replies.
        """
        pipes = cls()
        request, theirs_request = pipes._pair(writes=True) if channel else (-1, -1)
        reply, theirs_reply = pipes._pair(writes=False) if channel else (-1, -1)
        printed, theirs_printed = pipes._pair(writes=False)
        pipes.request, pipes.reply, pipes.printed = request, reply, printed
        pipes.theirs = (theirs_request, theirs_reply, theirs_printed)
        return pipes

    def hand_over(self) -> None:
        """Close the other ends: the process has them."""
        for end in self.theirs:
            if end >= 0:
                os.close(end)
        self.theirs = (-1, -1, -1)

    def close(self) -> None:
        """Close all."""
        self.hand_over()
        while self.ours:
            os.close(self.ours.pop())
        self.request = self.reply = self.printed = -1

    def _pair(self, *, writes: bool) -> tuple[int, int]:
        """Our end and theirs."""
        reads, ends = os.pipe()
        ours, theirs = (ends, reads) if writes else (reads, ends)
        os.set_blocking(ours, False)
        self.ours.append(ours)
        return ours, theirs


def read(end: int) -> bytes:
    """What has come; empty where nothing has or can."""
    try:
        return os.read(end, READ)
    except OSError:
        return b""

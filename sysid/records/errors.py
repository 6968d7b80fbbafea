"""Error and warning classes of the package."""

import warnings
from collections.abc import Iterable, Mapping

MOST_CHARACTERS = 1000  # longest message, half a screen: names of channels in it have any length and number


class Message(str):
    """Text of an error or a warning that advises arguments, for programs that have other words for them.

    Attributes:
        code: Which message it is, e.g. `unstable-model`; stays the same when the words change.
        advice: Pieces of the text by the argument that they advise, e.g. `{"stable": "; stable=True ..."}`.
    """

    code: str
    advice: Mapping[str, str]

    def __new__(cls, text: str, code: str = "", **advice: str) -> "Message":
        """Keep the text, with the pieces of it that advise arguments."""
        message = super().__new__(cls, text)
        message.code, message.advice = code, advice
        return message


def reworded(text: str, advice: Mapping[str, str], words: Mapping[str, str]) -> str:
    """Replace the advice in a text of the package by words of another program; without words it is left out.

    Args:
        text: The text, or a longer one that quotes it.
        advice: Its pieces by argument, as `Message` has them.
        words: What to say instead, by argument.
    """
    for argument, piece in advice.items():
        text = text.replace(piece, words.get(argument, ""))
    return text


class _Advising(Exception):  # noqa: N818 - warnings derive from it too
    """An error or a warning that keeps the advice of its message.

    Attributes:
        code: Which message it is, where it advises arguments; see `Message`.
        advice: Pieces of the message by the argument that they advise.
    """

    def __init__(self, message: object = "") -> None:
        self.code: str = getattr(message, "code", "")
        self.advice: Mapping[str, str] = getattr(message, "advice", {})
        text = str(message)
        if len(text) > MOST_CHARACTERS:
            beginning, end = text[: 2 * MOST_CHARACTERS // 3], text[-MOST_CHARACTERS // 4 :]
            text = f"{beginning} ... ({len(text) - len(beginning) - len(end)} characters left out) ... {end}"
        super().__init__(text)


class SysidError(_Advising, ValueError):
    """Root of the errors of the package: each says what was given and, in the end, what was expected."""


class SysidWarning(_Advising, UserWarning):
    """Root of the warnings on numerics and data: poor excitation, rank, conditioning, instability."""


def warn_each(messages: Iterable[str], *, stacklevel: int = 1) -> None:
    """Warn of every message, at the caller of the calling function; `stacklevel` counts functions in between."""
    for message in messages:
        warnings.warn(message, SysidWarning, stacklevel=stacklevel + 2)

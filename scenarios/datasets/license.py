"""The licence of the data."""

from importlib.resources import files

SPDX = "CC-BY-4.0"
"""Its identifier."""

NAME = "Creative Commons Attribution 4.0 International"
"""Its name."""

URL = "https://creativecommons.org/licenses/by/4.0/"
"""Where its summary stands; the full text is at `legalcode` below it."""


def license_text(label: str, creators: tuple[str, ...]) -> str:
    """The notice for a data set and the full text of the licence; Creative Commons gave that text to the public domain.

    Args:
        label: Name of the data set with its version.
        creators: Who is to be named.
    """
    notice = (
        f"The data set {label}, by {'; '.join(creators)}, is licensed under\n"
        f"{NAME} (SPDX: {SPDX}).\n"
        f"Summary: {URL}\nFull text, also below: {URL}legalcode\n"
    )
    text = files("scenarios").joinpath("data", "licenses", "CC-BY-4.0.txt").read_text(encoding="utf-8")
    return f"{notice}\n{'=' * 71}\n\n{text.strip()}\n"

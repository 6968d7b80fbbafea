"""Text for people: foreign text made safe to print, counts with their nouns."""


def one_line(text: str) -> str:
    """The text on one line, characters that cannot be seen, or that steer a terminal, replaced."""
    return visible(" ".join(text.split()))


def visible(text: str) -> str:
    """The text with its lines, characters that cannot be seen, or that steer a terminal, replaced."""
    # Escape sequences are made of characters that are not printable.
    replaced = {character for character in text if not (character.isprintable() or character == "\n")}
    return text.translate({ord(character): "\N{REPLACEMENT CHARACTER}" for character in replaced})


def counted(count: int, noun: str) -> str:
    """A count with its noun, in the plural except after 1."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"

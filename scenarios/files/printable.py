"""Foreign text made safe to print: one line, control characters replaced."""


def one_line(text: str) -> str:
    """The text on one line, characters that cannot be seen, or that steer a terminal, replaced."""
    return visible(" ".join(text.split()))


def visible(text: str) -> str:
    """The text with its lines, characters that cannot be seen, or that steer a terminal, replaced."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)

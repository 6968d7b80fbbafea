"""What the analyst raises and what it warns of."""


class SysidError(ValueError):
    """Root of every error raised on purpose: says what was given and what was expected."""


class SysidWarning(UserWarning):
    """Root of every warning on numerics or physics: poor excitation, rank, conditioning, instability."""
